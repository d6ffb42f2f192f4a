/* Counts the instructions that the core takes on a Cortex-M4: QEMU's mps2-an386 with -icount.
 *
 * The file `steps` has the parameter memory and then the steps of sim/link.h, as another port was
 * given them; what this one makes of them goes to `answers`. Time is that of the steps. The layer is
 * the Nucleo's own, with its registers in memory (REG in build.py), so that its loops are counted
 * too; only what would come in bit by bit is put in place of what it read. */

#include "board.h"
#include "hal.h"
#include "link.h"
#include "stm32f446.h"

#define SYST_CTRL (*(volatile uint32_t *)0xE000E010u)
#define SYST_LOAD (*(volatile uint32_t *)0xE000E014u)
#define SYST_NOW (*(volatile uint32_t *)0xE000E018u)
#define SYST_BITS 0xFFFFFFu
/* -icount shift=10: 1024 ns an instruction; SysTick counts 25 MHz. */
#define INSTRUCTION_NS 1024u
#define COUNT_NS 40u
#define TRIED 1000u

#define SEMIHOSTED_OPEN 0x01u
#define SEMIHOSTED_WRITE 0x05u
#define SEMIHOSTED_READ 0x06u
#define SEMIHOSTED_EXIT 0x20u
#define STOPPED 0x20026u
#define READ_BINARY 1u
#define WRITE_BINARY 5u

void tim5_handler(void);
void usart2_handler(void);
uint16_t __real_hal_analog(enum hal_analog channel);
uint16_t __real_hal_rtd(uint8_t channel);
int32_t __real_hal_bridge(void);
uint32_t __real_hal_tacho_us(uint8_t pump);
void __real_hal_gate(bool on);
void __real_hal_current(uint8_t driver, uint16_t i_mA);
void __real_hal_drain(uint8_t valves);
void __real_hal_sample_timer(uint32_t period_us);

static struct link_to_board in;
static struct link_from_board out;
static uint8_t store[HAL_STORE_SIZE];
static uint64_t now_us;
static uint64_t tick_us;
static uint32_t period_us;
static uint32_t marked;

static uint32_t instructions_since(uint32_t before)
{
    uint32_t counts = (before - SYST_NOW) & SYST_BITS;
    return (counts * COUNT_NS + INSTRUCTION_NS / 2u) / INSTRUCTION_NS;
}

/* The computer's files */

static uint32_t semihosted(uint32_t what, const void *block)
{
    register uint32_t r0 __asm("r0") = what;
    register const void *r1 __asm("r1") = block;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void end(uint32_t status)
{
    uint32_t block[2] = {STOPPED, status};
    semihosted(SEMIHOSTED_EXIT, block);
}

static uint32_t opened(const char *name, uint32_t size, uint32_t mode)
{
    uint32_t block[3] = {(uint32_t)name, mode, size};
    return semihosted(SEMIHOSTED_OPEN, block);
}

static bool moved(uint32_t how, uint32_t file, void *data, uint32_t size)
{
    uint32_t block[3] = {file, (uint32_t)data, size};
    return size == 0 || semihosted(how, block) == 0;
}

/* What the layer reads and sets */

uint16_t __wrap_hal_analog(enum hal_analog channel)
{
    ADC1_SR = BIT(1);
    ADC1_DR = (uint32_t)in.head.analog[channel] << 2;
    return __real_hal_analog(channel);
}

uint16_t __wrap_hal_rtd(uint8_t channel)
{
    (void)__real_hal_rtd(channel);
    return in.head.rtd[channel];
}

int32_t __wrap_hal_bridge(void)
{
    (void)__real_hal_bridge();
    return in.head.bridge;
}

uint32_t __wrap_hal_tacho_us(uint8_t pump)
{
    (void)__real_hal_tacho_us(pump);
    return in.head.tacho_us[pump];
}

void __wrap_hal_gate(bool on)
{
    __real_hal_gate(on);
    out.head.gate = on;
}

void __wrap_hal_current(uint8_t driver, uint16_t i_mA)
{
    __real_hal_current(driver, i_mA);
    out.head.current_mA[driver] = i_mA;
}

void __wrap_hal_drain(uint8_t valves)
{
    __real_hal_drain(valves);
    out.head.drain = valves;
}

void __wrap_hal_sample_timer(uint32_t wanted_us)
{
    __real_hal_sample_timer(wanted_us);
    period_us = wanted_us;
    tick_us = now_us + wanted_us;
}

uint8_t __wrap_hal_store_read(uint16_t address)
{
    return store[address];
}

void __wrap_hal_store_write(uint16_t address, uint8_t value)
{
    store[address] = value;
}

void __wrap_hal_mark(bool on)
{
    if (on) {
        marked = SYST_NOW;
    } else {
        out.head.sample_cycles = instructions_since(marked);
    }
}

/* Steps */

static void set_time(uint64_t t_us)
{
    now_us = t_us;
    TIM_CNT(TIM2) = (uint32_t)t_us;
}

static void send_all(void)
{
    while ((USART2_CR1 & BIT(7)) != 0) {
        USART2_SR = BIT(7);
        usart2_handler();
        if ((USART2_CR1 & BIT(7)) != 0) {
            out.bytes[out.head.size++] = (uint8_t)USART2_DR;
        }
    }
}

static void run_step(void)
{
    uint64_t end_us = now_us + in.head.dt_us;
    uint32_t polls = 1;
    GPIO_IDR(GPIOC) = ((in.head.inputs & HAL_INPUT_LEAK) == 0 ? BIT(13) : 0u)
                      | ((in.head.inputs & HAL_INPUT_ENCODER_ALARM) == 0 ? BIT(9) : 0u);
    TIM_CNT(TIM4) = (uint16_t)in.head.encoder;
    while (tick_us <= end_us) {
        set_time(tick_us);
        tick_us += period_us;
        tim5_handler();
        board_poll();
        send_all();
    }
    set_time(end_us);
    for (uint32_t i = 0; i < in.head.size; i++) {
        USART2_SR = BIT(5);
        USART2_DR = in.bytes[i];
        usart2_handler();
        polls += in.bytes[i] == 0;
    }
    while (polls-- > 0) {
        board_poll();
        send_all();
    }
}

static bool counts_right(void)
{
    uint32_t before = SYST_NOW;
    uint32_t counted;
    __asm volatile(".rept 1000\n nop\n .endr");
    counted = instructions_since(before);
    return counted >= TRIED && counted < TRIED + 10u;
}

int __wrap_main(void)
{
    uint32_t steps = opened("steps", 5, READ_BINARY);
    uint32_t answers = opened("answers", 7, WRITE_BINARY);
    SYST_LOAD = SYST_BITS;
    SYST_NOW = 0;
    SYST_CTRL = 5;
    if (!counts_right() || !moved(SEMIHOSTED_READ, steps, store, sizeof store)) {
        end(1);
    }
    GPIO_IDR(GPIOB) = BIT(4); /* converters that do not look as if they lost their settings */
    board_start();
    send_all();
    while (moved(SEMIHOSTED_READ, steps, &in.head, sizeof in.head)
           && moved(SEMIHOSTED_READ, steps, in.bytes, in.head.size)) {
        uint32_t before = SYST_NOW;
        run_step();
        out.head.watched[0] = instructions_since(before);
        out.head.t_us = now_us;
        for (uint8_t k = 0; k < HAL_NOINIT; k++) {
            out.head.noinit[k] = hal_noinit[k];
        }
        out.head.pump[0] = (uint8_t)TIM_CCR1(TIM3);
        out.head.pump[1] = (uint8_t)TIM_CCR2(TIM3);
        if (!moved(SEMIHOSTED_WRITE, answers, &out, sizeof out.head + out.head.size)) {
            end(1);
        }
        out.head.size = 0;
        out.head.sample_cycles = 0;
    }
    end(0);
    return 0;
}
