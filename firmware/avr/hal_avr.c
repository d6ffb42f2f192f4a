/* The core on an ATmega2560 at 16 MHz: the Arduino Mega, pins as in docs/firmware-wiring.md.
 *
 * Timer 1 counts half microseconds and is the clock. Timer 3 ticks the samples. Timer 4 drives the
 * pumps. Serial port, encoder and tachometers run on interrupts, each of a few microseconds; the
 * converters are read by the loop, bit by bit, so that it does not matter which pins they are on. */

#include "board.h"
#include "hal.h"

#include "smad_protocol.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#ifndef BAUD
#define BAUD 500000UL
#endif
#define UBRR_EXACT ((F_CPU / 8UL / BAUD) - 1UL)
#if (UBRR_EXACT + 1UL) * BAUD * 8UL != F_CPU
#error "this baud rate cannot be made exactly from the crystal; see docs/firmware-wiring.md"
#endif

/* Port B: the bus of the converters. */
#define SCK _BV(PB1)
#define MOSI _BV(PB2)
#define MISO _BV(PB3)
#define MARK _BV(PB7) /* the board's own light */
/* Port A: their selects, and the bridge's two lines. */
#define RTD_SELECTS (_BV(PA0) | _BV(PA1) | _BV(PA2) | _BV(PA3))
#define DAC_SELECT _BV(PA4)
#define BRIDGE_DATA _BV(PA5)
#define BRIDGE_CLOCK _BV(PA6)
#define ENCODER_ALARM _BV(PA7) /* low is alarm */
/* Port C: contacts and valves. */
#define GATE _BV(PC7)
#define DRAIN_X _BV(PC6)
#define DRAIN_Y _BV(PC5)
#define LEAK _BV(PC4) /* low is wet */
/* Port H: pumps. */
#define PUMPS (_BV(PH3) | _BV(PH4))

#define RTD_CONFIG_WRITE 0x80u
#define RTD_CONFIG 0xC3u /* bias on, converting, four wires, clear fault, 50 Hz */
#define RTD_READ 0x01u
#define DAC_ON 0x3000u /* gain 1, active */
#define DAC_SECOND 0x8000u
#define BRIDGE_BITS 24u
#define BRIDGE_SILENT 50u /* samples without a conversion: the bridge is dead */
#define BRIDGE_DEAD 8388607
#define TACHO_STANDS_US 200000u
#define UID_AT 4084u

const char hal_name[] = "smad-mega 1.0";

static uint8_t reset_cause __attribute__((section(".noinit")));

/* Before anything else: after a watchdog reset the watchdog stays armed at its shortest time. */
void early(void) __attribute__((naked, used, section(".init3")));
void early(void)
{
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

/* Time */

static volatile uint32_t overflows;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

/* With interrupts off. A count that has just wrapped is ahead of its overflow. */
static uint32_t time_us(void)
{
    uint16_t count = TCNT1;
    uint32_t high = overflows;
    if ((TIFR1 & _BV(TOV1)) != 0 && count < 0x8000u) {
        high++;
    }
    return (high << 15) | (count >> 1);
}

uint32_t hal_time_us(void)
{
    uint32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = time_us();
    }
    return now;
}

static volatile bool tick_waits;
static volatile uint8_t converting = HAL_ANALOGS;
static volatile uint32_t tick_us;
static uint32_t tick_period_us;

ISR(TIMER3_COMPA_vect)
{
    /* The first reading is taken at the tick itself, however late the loop comes. */
    ADMUX = _BV(REFS0) | HAL_I_X;
    ADCSRA |= _BV(ADSC);
    converting = HAL_I_X;
    tick_us += tick_period_us;
    tick_waits = true;
}

/* Timer 3 counts the same half microseconds as the clock, so ticks are whole periods of it. */
void hal_sample_timer(uint32_t period_us)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TCCR3B = 0;
        TCNT3 = 0;
        OCR3A = (uint16_t)(period_us * 2u - 1u);
        TIFR3 = _BV(OCF3A);
        tick_period_us = period_us;
        tick_us = time_us();
        TIMSK3 = _BV(OCIE3A);
        TCCR3B = _BV(WGM32) | _BV(CS31);
    }
}

bool hal_sample_due(uint32_t *t_us)
{
    bool due;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        due = tick_waits;
        tick_waits = false;
        *t_us = tick_us;
    }
    return due;
}

/* Serial port */

static volatile uint8_t received[256];
static volatile uint8_t received_head;
static uint8_t received_tail;
static volatile uint8_t to_send[256];
static uint8_t to_send_head;
static volatile uint8_t to_send_tail;

ISR(USART0_RX_vect)
{
    uint8_t byte = UDR0;
    uint8_t next = (uint8_t)(received_head + 1u);
    if (next != received_tail) {
        received[received_head] = byte;
        received_head = next;
    }
}

ISR(USART0_UDRE_vect)
{
    uint8_t tail = to_send_tail;
    UDR0 = to_send[tail];
    tail++;
    to_send_tail = tail;
    if (tail == to_send_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    }
}

int hal_serial_read(void)
{
    uint8_t byte;
    if (received_tail == received_head) {
        return -1;
    }
    byte = received[received_tail];
    received_tail++;
    return byte;
}

uint16_t hal_serial_room(void)
{
    return (uint8_t)(to_send_tail - to_send_head - 1u);
}

void hal_serial_write(const uint8_t *data, uint16_t size)
{
    uint8_t head = to_send_head;
    for (uint8_t left = (uint8_t)size; left > 0; left--) {
        to_send[head] = *data++;
        head++;
    }
    to_send_head = head;
}

uint16_t hal_most_rate_hz(void)
{
    return 100; /* a sample takes 3 ms of its 10 */
}

uint32_t hal_serial_baud(void)
{
    return BAUD;
}

static volatile bool store_ready;

/* Sleeps until there is something to do, unless something waits already: the instruction after sei comes
 * before any interrupt, so nothing can slip in between. */
void hal_sleep(void)
{
    cli();
    if (to_send_head != to_send_tail) {
        /* Only now: its interrupts would lengthen the sample that made the bytes. */
        UCSR0B |= _BV(UDRIE0);
    }
    while (!tick_waits && received_tail == received_head && !store_ready) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
        cli();
    }
    store_ready = false;
    sei();
}

/* Readings */

static void convert(uint8_t channel)
{
    ADMUX = (uint8_t)(_BV(REFS0) | channel);
    ADCSRA |= _BV(ADSC);
    converting = channel;
}

/* Begins the following channel before it returns, for the loop to do something else meanwhile. */
uint16_t hal_analog(enum hal_analog channel)
{
    uint16_t code;
    if (converting != channel) {
        convert(channel);
    }
    while ((ADCSRA & _BV(ADSC)) != 0) {
    }
    code = ADC;
    if (channel + 1u < HAL_ANALOGS) {
        convert((uint8_t)(channel + 1u));
    } else {
        converting = HAL_ANALOGS;
    }
    return code;
}

/* One byte out and one in. The converters put out on the rising edge and the DAC takes in on it;
 * the converters take in on the falling one. */
static uint8_t swap_byte(uint8_t out)
{
    uint8_t in = 0;
    for (uint8_t bit = 0; bit < 8; bit++) {
        if ((out & 0x80u) != 0) {
            PORTB |= MOSI;
        } else {
            PORTB &= (uint8_t)~MOSI;
        }
        out = (uint8_t)(out << 1);
        PORTB |= SCK;
        in = (uint8_t)(in << 1);
        if ((PINB & MISO) != 0) {
            in |= 1u;
        }
        PORTB &= (uint8_t)~SCK;
    }
    return in;
}

static void configure_rtd(uint8_t select)
{
    PORTA &= (uint8_t)~select;
    swap_byte(RTD_CONFIG_WRITE);
    swap_byte(RTD_CONFIG);
    PORTA |= select;
}

uint16_t hal_rtd(uint8_t channel)
{
    uint8_t select = (uint8_t)(_BV(PA0) << channel);
    uint16_t code;
    PORTA &= (uint8_t)~select;
    swap_byte(RTD_READ);
    code = (uint16_t)((uint16_t)swap_byte(0) << 8);
    code |= swap_byte(0);
    PORTA |= select;
    if (code == 0) {
        /* A short, or a converter that lost its supply for a moment and its settings with it. */
        configure_rtd(select);
    }
    return code;
}

int32_t hal_bridge(void)
{
    static int32_t latest;
    static uint8_t silent;
    uint32_t code = 0;
    if ((PINA & BRIDGE_DATA) != 0) {
        silent += silent < BRIDGE_SILENT;
        return silent < BRIDGE_SILENT ? latest : BRIDGE_DEAD;
    }
    silent = 0;
    for (uint8_t bit = 0; bit < BRIDGE_BITS; bit++) {
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
        {
            /* A clock that stays high for 60 us switches the converter off. */
            PORTA |= BRIDGE_CLOCK;
            code <<= 1;
            PORTA &= (uint8_t)~BRIDGE_CLOCK;
        }
        if ((PINA & BRIDGE_DATA) != 0) {
            code |= 1u;
        }
    }
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        PORTA |= BRIDGE_CLOCK; /* a 25th pulse: gain 128 again */
        __builtin_avr_delay_cycles(4);
        PORTA &= (uint8_t)~BRIDGE_CLOCK;
    }
    if ((code & 0x800000u) != 0) {
        code |= 0xFF000000u;
    }
    latest = (int32_t)code;
    return latest;
}

/* Quadrature: steps by (old B, old A, new B, new A). An edge that was missed counts nothing. */
static volatile uint16_t encoder_steps;
static volatile uint8_t encoder_old;
static const int8_t STEPS[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};

ISR(INT4_vect)
{
    uint8_t now = (uint8_t)((PINE >> 4) & 3u);
    encoder_steps = (uint16_t)(encoder_steps + STEPS[(encoder_old << 2) | now]);
    encoder_old = now;
}
ISR(INT5_vect, ISR_ALIASOF(INT4_vect));

int32_t hal_encoder(void)
{
    static uint16_t seen;
    static int32_t counts;
    uint16_t steps;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        steps = encoder_steps;
    }
    counts += (int16_t)(steps - seen);
    seen = steps;
    return counts;
}

static volatile uint32_t pulse_us[2];
static volatile uint32_t pulse_period_us[2];

static inline void on_pulse(uint8_t pump)
{
    uint32_t now = time_us();
    pulse_period_us[pump] = now - pulse_us[pump];
    pulse_us[pump] = now;
}

ISR(INT3_vect)
{
    on_pulse(0);
}

ISR(INT2_vect)
{
    on_pulse(1);
}

uint32_t hal_tacho_us(uint8_t pump)
{
    uint32_t period;
    uint32_t since;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        period = pulse_period_us[pump];
        since = time_us() - pulse_us[pump];
        if (since > TACHO_STANDS_US) {
            /* The next pulse begins a new measurement. */
            pulse_us[pump] += since - TACHO_STANDS_US;
            pulse_period_us[pump] = 0;
            period = 0;
        }
    }
    return period < TACHO_STANDS_US ? period : 0;
}

uint8_t hal_inputs(void)
{
    uint8_t inputs = 0;
    if ((PINC & LEAK) == 0) {
        inputs |= HAL_INPUT_LEAK;
    }
    if ((PINA & ENCODER_ALARM) == 0) {
        inputs |= HAL_INPUT_ENCODER_ALARM;
    }
    return inputs;
}

/* Outputs */

void hal_gate(bool on)
{
    if (on) {
        PORTC |= GATE;
    } else {
        PORTC &= (uint8_t)~GATE;
    }
}

void hal_current(uint8_t driver, uint16_t i_mA)
{
    static uint16_t set[2] = {0xFFFFu, 0xFFFFu};
    uint16_t word = (uint16_t)(DAC_ON | (i_mA & 0x0FFFu) | (driver != 0 ? DAC_SECOND : 0u));
    if (set[driver] == i_mA) {
        return;
    }
    set[driver] = i_mA;
    PORTA &= (uint8_t)~DAC_SELECT;
    swap_byte((uint8_t)(word >> 8));
    swap_byte((uint8_t)word);
    PORTA |= DAC_SELECT;
}

void hal_pump(uint8_t pump, uint8_t duty)
{
    if (pump == 0) {
        OCR4A = duty;
    } else {
        OCR4B = duty;
    }
}

void hal_drain(uint8_t valves)
{
    uint8_t port = PORTC & (uint8_t)~(DRAIN_X | DRAIN_Y);
    port |= (valves & 1u) != 0 ? DRAIN_X : 0;
    port |= (valves & 2u) != 0 ? DRAIN_Y : 0;
    PORTC = port;
}

/* Store */

uint8_t hal_store_read(uint16_t address)
{
    return eeprom_read_byte((const uint8_t *)address);
}

ISR(EE_READY_vect)
{
    EECR &= (uint8_t)~_BV(EERIE);
    store_ready = true;
}

void hal_store_write(uint16_t address, uint8_t value)
{
    EEAR = address;
    EEDR = value;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        EECR = _BV(EEMPE);
        EECR |= _BV(EEPE);
        EECR |= _BV(EERIE);
    }
}

bool hal_store_busy(void)
{
    return (EECR & _BV(EEPE)) != 0;
}

/* Watchdog and identity */

void hal_watchdog_kick(void)
{
    wdt_reset();
}

uint8_t hal_reset_cause(void)
{
    if ((reset_cause & _BV(WDRF)) != 0) {
        return SMAD_RESET_CAUSE_WATCHDOG;
    }
    if ((reset_cause & _BV(BORF)) != 0) {
        return SMAD_RESET_CAUSE_BROWN_OUT;
    }
    if ((reset_cause & _BV(PORF)) != 0) {
        return SMAD_RESET_CAUSE_POWER_ON;
    }
    return (reset_cause & _BV(EXTRF)) != 0 ? SMAD_RESET_CAUSE_PIN : SMAD_RESET_CAUSE_UNKNOWN;
}

void hal_mark(bool on)
{
    if (on) {
        PORTB |= MARK;
    } else {
        PORTB &= (uint8_t)~MARK;
    }
}

void hal_uid(uint8_t uid[12])
{
    eeprom_read_block(uid, (const void *)UID_AT, 12);
}

static void start_pins(void)
{
    PORTA = RTD_SELECTS | DAC_SELECT | ENCODER_ALARM;
    DDRA = RTD_SELECTS | DAC_SELECT | BRIDGE_CLOCK;
    DDRB = SCK | MOSI | MARK;
    PORTC = LEAK;
    DDRC = GATE | DRAIN_X | DRAIN_Y;
    PORTD = _BV(PD2) | _BV(PD3);
    PORTE = _BV(PE4) | _BV(PE5);
    DDRH = PUMPS;
}

int main(void)
{
    start_pins();
    TIMSK1 = _BV(TOIE1);
    TCCR1B = _BV(CS11);
    /* Pumps: phase-correct 8 bits, 31 kHz; a duty of 0 is off. */
    TCCR4A = _BV(COM4A1) | _BV(COM4B1) | _BV(WGM40);
    TCCR4B = _BV(CS40);
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1); /* 250 kHz: 52 us, and still 10 bits */
    /* Encoder on both edges, tachometers on the falling one. */
    EICRA = _BV(ISC21) | _BV(ISC31);
    EICRB = _BV(ISC40) | _BV(ISC50);
    encoder_old = (uint8_t)((PINE >> 4) & 3u);
    EIMSK = _BV(INT2) | _BV(INT3) | _BV(INT4) | _BV(INT5);
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UBRR0 = (uint16_t)UBRR_EXACT;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    set_sleep_mode(SLEEP_MODE_IDLE);
    for (uint8_t channel = 0; channel < 4; channel++) {
        configure_rtd((uint8_t)(_BV(PA0) << channel));
    }
    wdt_enable(WDTO_120MS);
    sei();
    board_start();
    for (;;) {
        board_poll();
        hal_sleep();
    }
}
