/* An Arduino Mega with the parts of the wiring page around it, on libsimavr, behind sim/link.h.
 *
 *   smad-simavr --elf FILE --link FD --store FILE [--cause N] [--noinit N,N,N,N] [--watch ADDRESS] ...
 *
 * This program is linked with libsimavr, which is under the GNU General Public License, version 3;
 * so is this program as a whole. It is a tool of the tests and the simulated bench. Nothing of it
 * is in the image that is flashed.
 *
 * The chip runs exactly as many cycles as the link says, so that a run is the same to the bit each
 * time. What the pins show changes at the beginning of a step, the encoder's edges are spread over
 * its first half. Bytes go in and out at the speed of the serial port. */

#include "../core/hal.h"
#include "link.h"
#include "parts.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "avr_eeprom.h"
#include "avr_uart.h"
#include "sim_avr.h"
#include "sim_cycle_timers.h"
#include "sim_elf.h"
#include "sim_irq.h"

#define SUPPLY_MV 5000u
#define STORE_SIZE 1024u
#define STEP_CYCLES 2000u
#define REG_MCUSR 0x54
#define REG_OCR4AL 0xA8
#define REG_OCR4BL 0xAA
#define REG_PORTC 0x28
#define REG_DDRC 0x27
#define GATE 7
#define DRAIN_X 6
#define DRAIN_Y 5
#define CAUSE_PIN 2
#define CAUSE_WATCHDOG 4
#define CAUSE_BROWN_OUT 5

static avr_t *avr;
static avr_uart_t *uart;
static avr_cycle_count_t byte_cycles;
static avr_run_t usual_run;
static avr_cycle_count_t reset_cycle;
static const uint8_t JUMP_TO_ITSELF[2] = {0xFF, 0xCF};
static const uint8_t SLEEP[2] = {0x88, 0x95};
static avr_cycle_count_t stall_end;
static bool hung;
static bool deaf;
static avr_flashaddr_t hung_at;
static uint8_t hung_word[2];
static uint16_t resets;
static uint16_t watch_at[LINK_WATCHED];
static uint16_t noinit_at;
static uint8_t watches;
static int store_fd;
static uint8_t stored[STORE_SIZE];

static struct link_to_board in;
static struct link_from_board out;

/* Bytes on their way to the chip. */
static uint8_t *queue;
static size_t queue_size;
static size_t queue_at;
static size_t queue_room;
static bool uart_full;

static void fail(const char *what)
{
    fprintf(stderr, "smad-simavr: %s: %s\n", what, strerror(errno));
    exit(1);
}

/* Serial port */

static void feed(void)
{
    avr_irq_t *input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    while (!uart_full && queue_at < queue_size) {
        avr_raise_irq(input, queue[queue_at++]);
    }
    if (queue_at == queue_size) {
        queue_at = queue_size = 0;
    }
}

static void enqueue(const uint8_t *data, size_t size)
{
    if (queue_size + size > queue_room) {
        queue_room = 2u * (queue_size + size);
        queue = realloc(queue, queue_room);
        if (queue == NULL) {
            fail("no memory");
        }
    }
    memcpy(queue + queue_size, data, size);
    queue_size += size;
}

static void on_room(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)value, (void)unused;
    uart_full = false;
    feed();
}

static void on_full(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)value, (void)unused;
    uart_full = true;
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)unused;
    if (out.head.size < LINK_BYTES) {
        out.bytes[out.head.size++] = (uint8_t)value;
    }
}

/* Steps */

static void on_reset(struct avr_io_t *unused)
{
    (void)unused;
    uart_full = false;
    parts_reset();
}

static void after_reset(void)
{
    reset_cycle = avr->cycle;
    parts_reset();
    parts_show(&in.head, 0);
}

static avr_io_t watcher = {.kind = "smad", .reset = on_reset};

static avr_cycle_count_t on_end(avr_t *chip, avr_cycle_count_t when, void *unused)
{
    (void)chip, (void)unused;
    /* It stays until the loop looks: a chip that goes to sleep in the last cycle of a step would
     * else sleep on to the next timer there is. */
    return when + 1u;
}

/* The loop hangs: where the program is, outside of interrupts, it jumps to itself for a while. Not
 * between sei and sleep: there a chip has no place for an interrupt, and would oversleep it. */
static void hang(void)
{
    bool asleep_next = memcmp(avr->flash + avr->pc, SLEEP, sizeof SLEEP) == 0;
    if (!hung && avr->cycle < stall_end && avr->sreg[S_I] && !asleep_next) {
        hung = true;
        hung_at = avr->pc;
        memcpy(hung_word, avr->flash + hung_at, sizeof hung_word);
        memcpy(avr->flash + hung_at, JUMP_TO_ITSELF, sizeof hung_word);
        if (deaf) {
            avr->sreg[S_I] = 0;
            avr->state = cpu_Running;
        }
    } else if (hung && avr->cycle >= stall_end) {
        hung = false;
        memcpy(avr->flash + hung_at, hung_word, sizeof hung_word);
        if (deaf) {
            avr->sreg[S_I] = 1;
        }
    }
}

static void run_until(avr_cycle_count_t end)
{
    /* Only so that the chip does not run past the end. */
    avr_cycle_timer_register(avr, end - avr->cycle, on_end, NULL);
    while (avr->cycle < end) {
        bool biting = avr->run != usual_run;
        if (biting) {
            stall_end = 0; /* the watchdog ends it */
        }
        hang();
        int state = avr_run(avr);
        if (biting) {
            /* What ran was the reset of the watchdog. */
            resets++;
            after_reset();
            avr_cycle_timer_register(avr, end - avr->cycle, on_end, NULL);
        }
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "smad-simavr: the chip stopped at 0x%x\n", (unsigned)avr->pc);
            exit(1);
        }
        if (uart != NULL && uart->cycles_per_byte != byte_cycles) {
            /* Newly set: simavr counts eleven bits to a byte; there are ten. */
            byte_cycles = uart->cycles_per_byte * 10u / 11u;
            uart->cycles_per_byte = byte_cycles;
        }
    }
}

static void save_store(void)
{
    avr_eeprom_desc_t now = {.ee = NULL, .offset = 0, .size = STORE_SIZE};
    avr_ioctl(avr, AVR_IOCTL_EEPROM_GET, &now);
    for (uint16_t at = 0; now.ee != NULL && at < STORE_SIZE; at++) {
        if (now.ee[at] != stored[at]) {
            stored[at] = now.ee[at];
            if (pwrite(store_fd, stored + at, 1, at) != 1) {
                fail("cannot write the store");
            }
        }
    }
}

static void load_store(const char *name)
{
    avr_eeprom_desc_t desc = {.ee = stored, .offset = 0, .size = STORE_SIZE};
    ssize_t size;
    memset(stored, 0xFF, sizeof stored);
    store_fd = open(name, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (store_fd < 0) {
        fail(name);
    }
    size = pread(store_fd, stored, sizeof stored, 0);
    if (size < (ssize_t)sizeof stored && pwrite(store_fd, stored, sizeof stored, 0) < 0) {
        fail(name);
    }
    avr_ioctl(avr, AVR_IOCTL_EEPROM_SET, &desc);
}

static void answer(int link)
{
    uint8_t driven = avr->data[REG_PORTC] & avr->data[REG_DDRC];
    out.head.t_us = (avr->cycle - reset_cycle) / MHZ;
    parts_currents(out.head.current_mA);
    out.head.sample_cycles = parts_sample_cycles();
    out.head.pump[0] = avr->data[REG_OCR4AL];
    out.head.pump[1] = avr->data[REG_OCR4BL];
    out.head.gate = driven >> GATE & 1u;
    out.head.drain = (uint8_t)((driven >> DRAIN_X & 1u) | (driven >> DRAIN_Y & 1u) << 1);
    out.head.resets = resets;
    for (uint8_t k = 0; k < watches; k++) {
        memcpy(&out.head.watched[k], avr->data + watch_at[k], sizeof out.head.watched[k]);
    }
    memcpy(out.head.noinit, avr->data + noinit_at, sizeof out.head.noinit);
    save_store();
    if (send(link, &out, sizeof out.head + out.head.size, 0) < 0) {
        exit(errno == EPIPE ? 0 : 1);
    }
    out.head.size = 0;
}

static void serve(int link)
{
    avr_cycle_count_t end = avr->cycle;
    ssize_t size;
    while ((size = recv(link, &in, sizeof in, 0)) > 0) {
        if ((size_t)size != sizeof in.head + in.head.size) {
            fprintf(stderr, "smad-simavr: a message of %zd bytes does not fit\n", size);
            exit(1);
        }
        end += (avr_cycle_count_t)in.head.dt_us * MHZ;
        parts_show(&in.head, in.head.dt_us);
        enqueue(in.bytes, in.head.size);
        feed();
        if (in.head.stall_us > 0) {
            stall_end = avr->cycle + (avr_cycle_count_t)in.head.stall_us * MHZ;
            deaf = in.head.deaf != 0;
        }
        run_until(end);
        answer(link);
    }
}

static void no_sleep(avr_t *chip, avr_cycle_count_t how_long)
{
    (void)chip;
    (void)how_long; /* no waiting: time is the link's */
}

static void quiet(avr_t *chip, const int level, const char *format, va_list arguments)
{
    (void)chip;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, arguments);
    }
}

static void wire_up(void)
{
    uint32_t flags = 0; /* no copy of the bytes on standard output */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT),
                            on_byte, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON),
                            on_room, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF),
                            on_full, NULL);
    parts_wire(avr);
    for (avr_io_t *io = avr->io_port; io != NULL; io = io->next) {
        if (strcmp(io->kind, "uart") == 0 && ((avr_uart_t *)io)->name == '0') {
            uart = (avr_uart_t *)io;
        }
    }
    avr_register_io(avr, &watcher);
}

static void set_cause(int cause)
{
    /* A rising supply passes the brown-out detector: power-up leaves both flags. */
    uint8_t bit = cause == CAUSE_PIN ? 2 : cause == CAUSE_BROWN_OUT ? 4 : 1 | 4;
    avr->data[REG_MCUSR] = cause == CAUSE_WATCHDOG ? 8 : bit;
}

/* What the chip's own memory keeps of the time before this reset. */
static void set_noinit(const elf_firmware_t *image, const char *words)
{
    uint32_t noinit[LINK_NOINIT] = {0};
    (void)sscanf(words, "%u,%u,%u,%u", &noinit[0], &noinit[1], &noinit[2], &noinit[3]);
    for (uint32_t i = 0; i < image->symbolcount; i++) {
        if (strcmp(image->symbol[i]->symbol, "hal_noinit") == 0) {
            noinit_at = (uint16_t)image->symbol[i]->addr;
            memcpy(avr->data + noinit_at, noinit, sizeof noinit);
        }
    }
}

int main(int count, char **arguments)
{
    elf_firmware_t image;
    const char *elf = NULL;
    const char *store = NULL;
    int link = -1;
    int cause = 1;
    const char *noinit = "";
    for (int i = 1; i + 1 < count; i += 2) {
        if (strcmp(arguments[i], "--elf") == 0) {
            elf = arguments[i + 1];
        } else if (strcmp(arguments[i], "--store") == 0) {
            store = arguments[i + 1];
        } else if (strcmp(arguments[i], "--link") == 0) {
            link = atoi(arguments[i + 1]);
        } else if (strcmp(arguments[i], "--cause") == 0) {
            cause = atoi(arguments[i + 1]);
        } else if (strcmp(arguments[i], "--noinit") == 0) {
            noinit = arguments[i + 1];
        } else if (strcmp(arguments[i], "--watch") == 0 && watches < LINK_WATCHED) {
            watch_at[watches++] = (uint16_t)strtoul(arguments[i + 1], NULL, 0);
        }
    }
    if (elf == NULL || store == NULL || link < 0) {
        fprintf(stderr, "usage: %s --elf FILE --link FD --store FILE [--cause N]\n", arguments[0]);
        return 2;
    }
    avr_global_logger_set(quiet);
    memset(&image, 0, sizeof image);
    if (elf_read_firmware(elf, &image) != 0) {
        errno = ENOENT;
        fail(elf);
    }
    avr = avr_make_mcu_by_name("atmega2560");
    if (avr == NULL) {
        errno = ENODEV;
        fail("atmega2560");
    }
    avr_init(avr);
    avr->frequency = MHZ * 1000000u;
    avr->vcc = avr->avcc = avr->aref = SUPPLY_MV;
    avr_load_firmware(avr, &image);
    avr->frequency = MHZ * 1000000u;
    avr->sleep = no_sleep;
    avr->run_cycle_limit = STEP_CYCLES;
    usual_run = avr->run;
    wire_up();
    load_store(store);
    on_reset(NULL);
    set_cause(cause);
    set_noinit(&image, noinit);
    after_reset();
    serve(link);
    return 0;
}
