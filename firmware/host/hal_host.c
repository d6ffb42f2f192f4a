/* The core as a Linux process: on virtual time, in lockstep with a plant (sim/link.h), or by itself
 * in real time behind a pseudo-terminal (realtime.c).
 *
 *   smad-firmware-host --link FD --store FILE [--time US] [--cause N] [--resets N] [--noinit N,N,N,N]
 *   smad-firmware-host --pty NAME --store FILE [--cause N]
 *
 * FD is one end of a SOCK_SEQPACKET pair. Power-up takes no time; after that time passes only as
 * the link says: to each tick of the sample timer and each end of a write to the store, then to
 * the end of the step, when the bytes of the step arrive. A watchdog that bites runs this program
 * anew, as a reset runs a chip's. */

#include "board.h"
#include "hal.h"
#include "link.h"
#include "realtime.h"

#include "smad_protocol.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define NEVER UINT64_MAX
#define WATCHDOG_US 120000u
#define STORE_WRITE_US 3400u
#define BAUD 921600u
#define UART_BYTES 512u /* what the chip's buffer holds while its loop hangs */

const char hal_name[] = "smad-host 1.0";

static struct {
    int link;
    int store_fd;
    const char *pty;
    const char *program;
    const char *store_name;
    uint8_t cause;
    uint16_t resets;
} run;

volatile uint32_t hal_noinit[HAL_NOINIT];
static uint8_t store[HAL_STORE_SIZE];
static uint64_t store_ready_us;

static uint64_t now_us;
static uint64_t end_us;
static uint64_t stall_end_us;
static uint64_t kicked_us;
static uint64_t period_us;
static uint64_t tick_us = NEVER;
static uint64_t last_tick_us;
static bool tick_waits;
static bool linked;

static struct link_to_board in;
static struct link_from_board out;
static bool arrived;
static uint8_t received[2u * LINK_BYTES];
static uint16_t received_size;
static uint16_t received_at;

/* Time */

uint32_t hal_time_us(void)
{
    return (uint32_t)now_us;
}

void hal_sample_timer(uint32_t wanted_us)
{
    bool first = period_us == 0;
    period_us = wanted_us;
    tick_us = (first ? now_us : last_tick_us) + period_us;
    if (tick_us <= now_us) {
        tick_us = now_us + period_us;
    }
}

bool hal_sample_due(uint32_t *t_us)
{
    bool due = tick_waits;
    tick_waits = false;
    *t_us = (uint32_t)last_tick_us;
    return due;
}

static void die(const char *what)
{
    fprintf(stderr, "smad-firmware-host: %s: %s\n", what, strerror(errno));
    exit(1);
}

/* The reset of a watchdog: nothing survives but the store, hal_noinit and the rest of the step. */
static void restart(void)
{
    char link[16];
    char resets[16];
    char cause[16];
    char noinit[48];
    (void)snprintf(link, sizeof link, "%d", run.link);
    (void)snprintf(resets, sizeof resets, "%u", run.resets + 1u);
    (void)snprintf(cause, sizeof cause, "%u", (unsigned)SMAD_RESET_CAUSE_WATCHDOG);
    (void)snprintf(noinit, sizeof noinit, "%u,%u,%u,%u", hal_noinit[0], hal_noinit[1], hal_noinit[2],
                   hal_noinit[3]);
    (void)fflush(NULL);
    close(run.store_fd);
    /* The plant still waits for the answer to this step: the program begins by giving it. */
    execl("/proc/self/exe", run.program, "--link", link, "--store", run.store_name, "--resets",
          resets, "--cause", cause, "--owes-answer", "1", "--noinit", noinit, (char *)NULL);
    die("cannot restart");
}

static void answer(void)
{
    out.head.t_us = now_us;
    out.head.resets = run.resets;
    for (uint8_t k = 0; k < HAL_NOINIT; k++) {
        out.head.noinit[k] = hal_noinit[k];
    }
    if (run.pty != NULL) {
        return; /* the next step writes it */
    }
    if (send(run.link, &out, sizeof out.head + out.head.size, 0) < 0) {
        exit(errno == EPIPE ? 0 : 1);
    }
    out.head.size = 0;
}

static void receive_step(void)
{
    ssize_t size = recv(run.link, &in, sizeof in, 0);
    if (size <= 0) {
        exit(0);
    }
    if ((size_t)size < sizeof in.head || (size_t)size != sizeof in.head + in.head.size) {
        fprintf(stderr, "smad-firmware-host: a message of %zd bytes does not fit\n", size);
        exit(1);
    }
}

static void next_step(void)
{
    if (run.pty != NULL) {
        uint64_t next = store_ready_us > now_us && store_ready_us < tick_us ? store_ready_us : tick_us;
        realtime_step(&out.head, out.bytes, &in, next - now_us);
        out.head.size = 0;
    } else {
        receive_step();
    }
    linked = true;
    end_us = now_us + in.head.dt_us;
    if (in.head.stall_us > 0) {
        stall_end_us = now_us + in.head.stall_us;
    }
    arrived = false;
}

/* Moves time to the next thing that happens, at most to the end of the step. */
static void advance(void)
{
    uint64_t next = end_us;
    bool stalled = now_us < stall_end_us;
    if (stalled) {
        next = stall_end_us < next ? stall_end_us : next;
    } else {
        next = tick_us < next ? tick_us : next;
        next = store_ready_us > now_us && store_ready_us < next ? store_ready_us : next;
    }
    if (kicked_us + WATCHDOG_US <= next) {
        now_us = kicked_us + WATCHDOG_US;
        restart();
    }
    now_us = next;
    while (tick_us <= now_us) {
        last_tick_us = tick_us;
        tick_us += period_us;
        tick_waits = true;
    }
}

static void take_bytes(void)
{
    uint16_t room = (uint16_t)(sizeof received - received_size);
    bool stalled = now_us < stall_end_us;
    uint16_t size = in.head.size;
    if (stalled) {
        uint16_t held = (uint16_t)(received_size - received_at);
        room = (uint16_t)(held < UART_BYTES ? UART_BYTES - held : 0);
    }
    size = size < room ? size : room;
    memcpy(received + received_size, in.bytes, size);
    received_size = (uint16_t)(received_size + size);
    arrived = true;
}

void hal_sleep(void)
{
    for (;;) {
        bool stalled = now_us < stall_end_us;
        if (!stalled && (tick_waits || received_at < received_size)) {
            return;
        }
        if (now_us < end_us) {
            uint64_t before = now_us;
            advance();
            if (now_us >= stall_end_us && store_ready_us > before && store_ready_us <= now_us) {
                return;
            }
        } else if (!arrived) {
            take_bytes();
        } else {
            answer();
            next_step();
        }
    }
}

/* Serial port */

int hal_serial_read(void)
{
    if (received_at == received_size) {
        received_at = received_size = 0;
        return -1;
    }
    return received[received_at++];
}

uint16_t hal_serial_room(void)
{
    return (uint16_t)(LINK_BYTES - out.head.size);
}

void hal_serial_write(const uint8_t *data, uint16_t size)
{
    memcpy(out.bytes + out.head.size, data, size);
    out.head.size = (uint16_t)(out.head.size + size);
}

uint16_t hal_most_rate_hz(void)
{
    return 0; /* virtual time stands still meanwhile */
}

uint32_t hal_serial_baud(void)
{
    return BAUD;
}

/* Readings */

uint16_t hal_analog(enum hal_analog channel)
{
    return in.head.analog[channel];
}

uint16_t hal_rtd(uint8_t channel)
{
    return in.head.rtd[channel];
}

int32_t hal_bridge(void)
{
    return in.head.bridge;
}

int32_t hal_encoder(void)
{
    return in.head.encoder;
}

uint32_t hal_tacho_us(uint8_t pump)
{
    return in.head.tacho_us[pump];
}

uint8_t hal_inputs(void)
{
    return in.head.inputs;
}

/* Outputs */

void hal_gate(bool on)
{
    out.head.gate = on;
}

void hal_current(uint8_t driver, uint16_t i_mA)
{
    out.head.current_mA[driver] = i_mA;
}

void hal_pump(uint8_t pump, uint8_t duty)
{
    out.head.pump[pump] = duty;
}

void hal_drain(uint8_t valves)
{
    out.head.drain = valves;
}

/* Store */

uint8_t hal_store_read(uint16_t address)
{
    return store[address];
}

void hal_store_write(uint16_t address, uint8_t value)
{
    store[address] = value;
    if (pwrite(run.store_fd, &value, 1, address) != 1) {
        die("cannot write the store");
    }
    store_ready_us = linked ? now_us + STORE_WRITE_US : now_us;
}

bool hal_store_busy(void)
{
    return store_ready_us > now_us;
}

static void open_store(void)
{
    ssize_t size;
    memset(store, 0xFF, sizeof store);
    run.store_fd = open(run.store_name, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (run.store_fd < 0) {
        die(run.store_name);
    }
    size = pread(run.store_fd, store, sizeof store, 0);
    if (size < (ssize_t)sizeof store && pwrite(run.store_fd, store, sizeof store, 0) < 0) {
        die(run.store_name);
    }
}

/* Watchdog and identity */

void hal_watchdog_kick(void)
{
    kicked_us = now_us;
}

uint8_t hal_reset_cause(void)
{
    return run.cause;
}

void hal_mark(bool on)
{
    (void)on; /* virtual time stands still meanwhile */
}

void hal_uid(uint8_t uid[12])
{
    memcpy(uid, "host process", 12);
}

int main(int count, char **arguments)
{
    bool owes = false;
    run.program = arguments[0];
    run.link = -1;
    run.cause = SMAD_RESET_CAUSE_POWER_ON;
    for (int i = 1; i + 1 < count; i += 2) {
        const char *name = arguments[i];
        const char *value = arguments[i + 1];
        if (strcmp(name, "--pty") == 0) {
            run.pty = value;
        } else if (strcmp(name, "--link") == 0) {
            run.link = atoi(value);
        } else if (strcmp(name, "--store") == 0) {
            run.store_name = value;
        } else if (strcmp(name, "--time") == 0) {
            now_us = strtoull(value, NULL, 10);
        } else if (strcmp(name, "--cause") == 0) {
            run.cause = (uint8_t)atoi(value);
        } else if (strcmp(name, "--resets") == 0) {
            run.resets = (uint16_t)atoi(value);
        } else if (strcmp(name, "--noinit") == 0) {
            (void)sscanf(value, "%u,%u,%u,%u", (unsigned *)&hal_noinit[0], (unsigned *)&hal_noinit[1],
                         (unsigned *)&hal_noinit[2], (unsigned *)&hal_noinit[3]);
        } else if (strcmp(name, "--owes-answer") == 0) {
            owes = true;
        }
    }
    if ((run.link < 0) == (run.pty == NULL) || run.store_name == NULL) {
        fprintf(stderr, "usage: %s --link FD | --pty NAME --store FILE [--time US] [--cause N]\n",
                arguments[0]);
        return 2;
    }
    open_store();
    last_tick_us = kicked_us = end_us = now_us;
    arrived = true;
    board_start();
    if (run.pty != NULL) {
        realtime_open(run.pty);
    }
    if (!owes) {
        next_step();
    }
    for (;;) {
        board_poll();
        hal_sleep();
    }
}
