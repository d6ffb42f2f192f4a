/* The core on an ATmega2560 at 16 MHz: the Arduino Mega, pins as in docs/firmware-wiring.md.
 *
 * Timer 1 counts half microseconds and is the clock. Timer 3 ticks the samples. Timer 4 drives the
 * pumps. Serial port, encoder and tachometers run on interrupts, each of a few microseconds; the
 * converters are read by the loop, bit by bit, so that it does not matter which pins they are on. */

#include "board.h"
#include "hal.h"
#include "mega.h"

#include "smad_protocol.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

const char hal_name[] = "smad-mega 1.0";

static uint8_t reset_cause __attribute__((section(".noinit")));
volatile uint32_t hal_noinit[HAL_NOINIT] __attribute__((section(".noinit")));

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
uint32_t mega_time_us(void)
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
        now = mega_time_us();
    }
    return now;
}

static volatile bool tick_waits;
static volatile uint32_t tick_us;
static uint32_t tick_period_us;

ISR(TIMER3_COMPA_vect)
{
    /* The first reading is taken at the tick itself, however late the loop comes. */
    mega_first_conversion();
    do {
        tick_us += tick_period_us; /* more than once when interrupts were kept from running */
    } while (mega_time_us() - tick_us >= tick_period_us);
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
        tick_us = mega_time_us();
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

static volatile bool store_ready;

/* Sleeps until there is something to do, unless something waits already: the instruction after sei comes
 * before any interrupt, so nothing can slip in between. */
void hal_sleep(void)
{
    cli();
    mega_send();
    while (!tick_waits && !mega_received() && !store_ready) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
        cli();
    }
    store_ready = false;
    sei();
}

uint16_t hal_most_rate_hz(void)
{
    return 100; /* a sample takes 3 ms of its 10 */
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
    mega_swap_byte((uint8_t)(word >> 8));
    mega_swap_byte((uint8_t)word);
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

/* A rising supply passes the brown-out detector too: after power-up both flags are set. */
uint8_t hal_reset_cause(void)
{
    if ((reset_cause & _BV(PORF)) != 0) {
        return SMAD_RESET_CAUSE_POWER_ON;
    }
    if ((reset_cause & _BV(WDRF)) != 0) {
        return SMAD_RESET_CAUSE_WATCHDOG;
    }
    if ((reset_cause & _BV(BORF)) != 0) {
        return SMAD_RESET_CAUSE_BROWN_OUT;
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
    PORTA = RTD_SELECTS | DAC_SELECT | ENCODER_ALARM | BRIDGE_DATA; /* unplugged is not ready */
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
    mega_start_serial();
    set_sleep_mode(SLEEP_MODE_IDLE);
    mega_start_readings();
    wdt_enable(WDTO_120MS);
    sei();
    board_start();
    for (;;) {
        board_poll();
        hal_sleep();
    }
}
