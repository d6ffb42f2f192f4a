/* The core on an STM32F446 at 84 MHz, a Nucleo-F446RE.
 *
 * THIS PORT HAS NEVER RUN ON SILICON. It is compiled, with warnings as errors, and nothing more.
 * Whoever flashes it first checks every pin by itself, with no spring mounted; see
 * docs/firmware-wiring.md.
 *
 * Pins: PA2/PA3 serial port of the ST-LINK. PA0, PA1, PA4, PB0, PC1 readings (i_x, i_y, v_x, v_y,
 * supply), from dividers for 3.3 V. PB3 clock, PB5 out, PB4 in of the converters' bus; PC0, PC2,
 * PC3, PC4 their selects, PC5 the DAC's, PC6 the store's (a FRAM of 2 kB or more). PC7 and PC8
 * data and clock of the bridge. PB6 and PB7 encoder, PC9 its alarm. PB8 and PB9 tachometers.
 * PA5 is on during a sample. PA6 and PA7 pumps. PC10 gate, PC11 and PC12 drain valves, PC13 leak contact. */

#include "board.h"
#include "hal.h"
#include "nucleo.h"
#include "stm32f446.h"

#include "smad_protocol.h"

#define BAUD 500000u
#define APB1_HZ 42000000u
#define SCK BIT(3)
#define MISO BIT(4)
#define MOSI BIT(5)
#define DAC_SELECT BIT(5)
#define STORE_SELECT BIT(6)
#define BRIDGE_DATA BIT(7)
#define BRIDGE_CLOCK BIT(8)
#define ENCODER_ALARM BIT(9)
#define GATE BIT(10)
#define DRAIN_X BIT(11)
#define DRAIN_Y BIT(12)
#define LEAK BIT(13)
#define MARK BIT(5) /* of port A: the board's own light */
#define LOW(bits) ((bits) << 16)

#define RTD_CONFIG_WRITE 0x80u
#define RTD_CONFIG 0xC3u
#define RTD_READ 0x01u
#define DAC_ON 0x3000u
#define DAC_SECOND 0x8000u
#define STORE_ENABLE 0x06u
#define STORE_WRITE 0x02u
#define STORE_READ 0x03u
#define BRIDGE_SILENT 50u
#define BRIDGE_DEAD 8388607
#define TACHO_STANDS_US 200000u
#define RING 512u
#define POWER_UP BIT(27)

const char hal_name[] = "smad-nucleo 1.0 untried";

static const uint32_t RTD_SELECT[4] = {BIT(0), BIT(2), BIT(3), BIT(4)};

/* Time */

uint32_t hal_time_us(void)
{
    return TIM_CNT(TIM2);
}

static volatile bool tick_waits;
static volatile uint32_t tick_us;
static uint32_t tick_period_us;

void tim5_handler(void)
{
    TIM_SR(TIM5) = 0;
    tick_us += tick_period_us;
    tick_waits = true;
}

void hal_sample_timer(uint32_t period_us)
{
    __asm volatile("cpsid i");
    TIM_CR1(TIM5) = 0;
    TIM_CNT(TIM5) = 0;
    TIM_ARR(TIM5) = period_us - 1u;
    TIM_SR(TIM5) = 0;
    tick_period_us = period_us;
    tick_us = hal_time_us();
    TIM_DIER(TIM5) = 1;
    TIM_CR1(TIM5) = 1;
    __asm volatile("cpsie i");
}

bool hal_sample_due(uint32_t *t_us)
{
    bool due;
    __asm volatile("cpsid i");
    due = tick_waits;
    tick_waits = false;
    *t_us = tick_us;
    __asm volatile("cpsie i");
    return due;
}

/* Serial port */

static volatile uint8_t received[RING];
static volatile uint32_t received_head;
static volatile uint32_t received_tail;
static volatile uint8_t to_send[RING];
static volatile uint32_t to_send_head;
static volatile uint32_t to_send_tail;

void usart2_handler(void)
{
    uint32_t status = USART2_SR;
    if ((status & (BIT(5) | BIT(3))) != 0) {
        uint8_t byte = (uint8_t)USART2_DR;
        if (received_head - received_tail < RING) {
            received[received_head % RING] = byte;
            received_head++;
        }
    }
    if ((status & BIT(7)) != 0 && (USART2_CR1 & BIT(7)) != 0) {
        if (to_send_tail == to_send_head) {
            USART2_CR1 &= ~BIT(7);
        } else {
            USART2_DR = to_send[to_send_tail % RING];
            to_send_tail++;
        }
    }
}

int hal_serial_read(void)
{
    uint8_t byte;
    if (received_tail == received_head) {
        return -1;
    }
    byte = received[received_tail % RING];
    received_tail++;
    return byte;
}

uint16_t hal_serial_room(void)
{
    return (uint16_t)(RING - (to_send_head - to_send_tail));
}

void hal_serial_write(const uint8_t *data, uint16_t size)
{
    for (uint16_t i = 0; i < size; i++) {
        to_send[to_send_head % RING] = data[i];
        to_send_head++;
    }
    USART2_CR1 |= BIT(7);
}

uint16_t hal_most_rate_hz(void)
{
    return 0;
}

uint32_t hal_serial_baud(void)
{
    return BAUD;
}

/* With interrupts masked wfi still wakes, so nothing can slip in between. */
void hal_sleep(void)
{
    __asm volatile("cpsid i");
    if (!tick_waits && received_tail == received_head) {
        __asm volatile("wfi");
    }
    __asm volatile("cpsie i");
}

/* Readings */

uint16_t hal_analog(enum hal_analog channel)
{
    static const uint8_t INPUT[HAL_ANALOGS] = {0, 1, 4, 8, 11};
    ADC1_SQR3 = INPUT[channel];
    ADC1_CR2 |= BIT(30);
    while ((ADC1_SR & BIT(1)) == 0) {
    }
    return (uint16_t)(ADC1_DR >> 2); /* 12 bits to the core's 10 */
}

/* A fraction of a microsecond: the converters stand 5 MHz at most. */
static void pause(void)
{
    for (volatile uint32_t i = 0; i < 3; i++) {
    }
}

static uint8_t swap_byte(uint8_t out)
{
    uint8_t in = 0;
    for (uint32_t bit = 0; bit < 8; bit++) {
        GPIO_BSRR(GPIOB) = (out & 0x80u) != 0 ? MOSI : LOW(MOSI);
        out = (uint8_t)(out << 1);
        pause();
        GPIO_BSRR(GPIOB) = SCK;
        pause();
        in = (uint8_t)(in << 1);
        if ((GPIO_IDR(GPIOB) & MISO) != 0) {
            in |= 1u;
        }
        GPIO_BSRR(GPIOB) = LOW(SCK);
    }
    return in;
}

static void configure_rtd(uint8_t channel)
{
    GPIO_BSRR(GPIOC) = LOW(RTD_SELECT[channel]);
    swap_byte(RTD_CONFIG_WRITE);
    swap_byte(RTD_CONFIG);
    GPIO_BSRR(GPIOC) = RTD_SELECT[channel];
}

uint16_t hal_rtd(uint8_t channel)
{
    uint16_t code;
    GPIO_BSRR(GPIOC) = LOW(RTD_SELECT[channel]);
    swap_byte(RTD_READ);
    code = (uint16_t)(swap_byte(0) << 8);
    code = (uint16_t)(code | swap_byte(0));
    GPIO_BSRR(GPIOC) = RTD_SELECT[channel];
    if (code == 0) {
        configure_rtd(channel);
    }
    return code;
}

int32_t hal_bridge(void)
{
    static int32_t latest = BRIDGE_DEAD;
    static uint32_t silent;
    uint32_t code = 0;
    if ((GPIO_IDR(GPIOC) & BRIDGE_DATA) != 0) {
        silent += silent < BRIDGE_SILENT;
        return silent < BRIDGE_SILENT ? latest : BRIDGE_DEAD;
    }
    silent = 0;
    for (uint32_t bit = 0; bit < 25; bit++) {
        /* A clock that stays high for 60 us switches the converter off. */
        __asm volatile("cpsid i");
        GPIO_BSRR(GPIOC) = BRIDGE_CLOCK;
        pause();
        GPIO_BSRR(GPIOC) = LOW(BRIDGE_CLOCK);
        __asm volatile("cpsie i");
        pause();
        if (bit < 24) {
            code = code << 1 | ((GPIO_IDR(GPIOC) & BRIDGE_DATA) != 0 ? 1u : 0u);
        }
    }
    latest = (int32_t)(code << 8) / 256;
    return latest;
}

int32_t hal_encoder(void)
{
    static uint16_t seen;
    static int32_t counts;
    uint16_t now = (uint16_t)TIM_CNT(TIM4);
    counts += (int16_t)(uint16_t)(now - seen);
    seen = now;
    return counts;
}

static volatile uint32_t pulse_us[2];
static volatile uint32_t pulse_period_us[2];

void exti9_5_handler(void)
{
    uint32_t now = hal_time_us();
    for (uint32_t pump = 0; pump < 2; pump++) {
        if ((EXTI_PR & BIT(8u + pump)) != 0) {
            EXTI_PR = BIT(8u + pump);
            pulse_period_us[pump] = now - pulse_us[pump];
            pulse_us[pump] = now;
        }
    }
}

uint32_t hal_tacho_us(uint8_t pump)
{
    uint32_t period;
    uint32_t since;
    __asm volatile("cpsid i");
    since = hal_time_us() - pulse_us[pump];
    if (since > TACHO_STANDS_US) {
        pulse_us[pump] += since - TACHO_STANDS_US;
        pulse_period_us[pump] = 0;
    }
    period = pulse_period_us[pump];
    __asm volatile("cpsie i");
    return period < TACHO_STANDS_US ? period : 0;
}

uint8_t hal_inputs(void)
{
    uint32_t pins = GPIO_IDR(GPIOC);
    uint32_t inputs = (pins & LEAK) == 0 ? HAL_INPUT_LEAK : 0u;
    inputs |= (pins & ENCODER_ALARM) == 0 ? HAL_INPUT_ENCODER_ALARM : 0u;
    return (uint8_t)inputs;
}

/* Outputs */

void hal_gate(bool on)
{
    GPIO_BSRR(GPIOC) = on ? GATE : LOW(GATE);
}

void hal_current(uint8_t driver, uint16_t i_mA)
{
    uint32_t word = DAC_ON | (i_mA & 0x0FFFu) | (driver != 0 ? DAC_SECOND : 0u);
    GPIO_BSRR(GPIOC) = LOW(DAC_SELECT);
    swap_byte((uint8_t)(word >> 8));
    swap_byte((uint8_t)word);
    GPIO_BSRR(GPIOC) = DAC_SELECT;
}

void hal_pump(uint8_t pump, uint8_t duty)
{
    if (pump == 0) {
        TIM_CCR1(TIM3) = duty;
    } else {
        TIM_CCR2(TIM3) = duty;
    }
}

void hal_drain(uint8_t valves)
{
    GPIO_BSRR(GPIOC) = (valves & 1u) != 0 ? DRAIN_X : LOW(DRAIN_X);
    GPIO_BSRR(GPIOC) = (valves & 2u) != 0 ? DRAIN_Y : LOW(DRAIN_Y);
}

/* Store: a FRAM, which writes a byte in no time. A new one holds zeros: erase it to 0xFF. */

uint8_t hal_store_read(uint16_t address)
{
    uint8_t value;
    GPIO_BSRR(GPIOC) = LOW(STORE_SELECT);
    swap_byte(STORE_READ);
    swap_byte((uint8_t)(address >> 8));
    swap_byte((uint8_t)address);
    value = swap_byte(0);
    GPIO_BSRR(GPIOC) = STORE_SELECT;
    return value;
}

void hal_store_write(uint16_t address, uint8_t value)
{
    GPIO_BSRR(GPIOC) = LOW(STORE_SELECT);
    swap_byte(STORE_ENABLE);
    GPIO_BSRR(GPIOC) = STORE_SELECT;
    pause();
    GPIO_BSRR(GPIOC) = LOW(STORE_SELECT);
    swap_byte(STORE_WRITE);
    swap_byte((uint8_t)(address >> 8));
    swap_byte((uint8_t)address);
    swap_byte(value);
    GPIO_BSRR(GPIOC) = STORE_SELECT;
}

bool hal_store_busy(void)
{
    return false;
}

/* Watchdog and identity */

void hal_watchdog_kick(void)
{
    IWDG_KR = 0xAAAAu;
}

static uint32_t reset_flags;
volatile uint32_t hal_noinit[HAL_NOINIT] __attribute__((section(".noinit")));

uint8_t hal_reset_cause(void)
{
    if ((reset_flags & POWER_UP) != 0) {
        return SMAD_RESET_CAUSE_POWER_ON;
    }
    if ((reset_flags & BIT(29)) != 0) {
        return SMAD_RESET_CAUSE_WATCHDOG;
    }
    if ((reset_flags & BIT(25)) != 0) {
        return SMAD_RESET_CAUSE_BROWN_OUT;
    }
    if ((reset_flags & BIT(28)) != 0) {
        return SMAD_RESET_CAUSE_SOFTWARE;
    }
    return (reset_flags & BIT(26)) != 0 ? SMAD_RESET_CAUSE_PIN : SMAD_RESET_CAUSE_UNKNOWN;
}

void hal_mark(bool on)
{
    GPIO_BSRR(GPIOA) = on ? MARK : LOW(MARK);
}

void hal_uid(uint8_t uid[12])
{
    for (uint32_t i = 0; i < 12; i++) {
        uid[i] = (uint8_t)(REG(UNIQUE_ID + (i & ~3u)) >> (8u * (i & 3u)));
    }
}

/* Start */

int main(void)
{
    reset_flags = RCC_CSR;
    RCC_CSR |= BIT(24);
    RCC_AHB1ENR |= BIT(0) | BIT(1) | BIT(2);
    RCC_APB1ENR |= BIT(0) | BIT(1) | BIT(2) | BIT(3) | BIT(17);
    RCC_APB2ENR |= BIT(8) | BIT(14);
    nucleo_start_pins();
    nucleo_start_clock();
    nucleo_start_timers();
    ADC_CCR = 1u << 16; /* 21 MHz: undivided it would be 42, and 36 is the most */
    ADC1_SMPR1 = 0x07FFFFFFu; /* the longest sampling time: the dividers are slow */
    ADC1_SMPR2 = 0x3FFFFFFFu;
    ADC1_CR2 = BIT(0) | BIT(10);
    SYSCFG_EXTICR3 = 1u | 1u << 4;
    EXTI_FTSR |= BIT(8) | BIT(9);
    EXTI_IMR |= BIT(8) | BIT(9);
    USART2_BRR = APB1_HZ / BAUD;
    USART2_CR1 = BIT(13) | BIT(5) | BIT(3) | BIT(2);
    NVIC_ISER(IRQ_EXTI9_5 / 32u) = BIT(IRQ_EXTI9_5 % 32u);
    NVIC_ISER(IRQ_USART2 / 32u) = BIT(IRQ_USART2 % 32u);
    NVIC_ISER(IRQ_TIM5 / 32u) = BIT(IRQ_TIM5 % 32u);
    for (uint8_t channel = 0; channel < 4; channel++) {
        configure_rtd(channel);
    }
    /* 32 kHz over 4, 960 counts: 120 ms. */
    IWDG_KR = 0x5555u;
    IWDG_PR = 0;
    IWDG_RLR = 960;
    IWDG_KR = 0xCCCCu;
    board_start();
    for (;;) {
        board_poll();
        hal_sleep();
    }
}
