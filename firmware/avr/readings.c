/* Everything that the Mega reads. The converters' bus is driven bit by bit, so that it does not
 * matter which pins it is on; encoder and tachometers run on interrupts. */

#include "hal.h"
#include "mega.h"

#include <avr/interrupt.h>
#include <util/atomic.h>

static volatile uint8_t converting = HAL_ANALOGS;

static void convert(uint8_t channel)
{
    ADMUX = (uint8_t)(_BV(REFS0) | channel);
    ADCSRA |= _BV(ADSC);
    converting = channel;
}

void mega_first_conversion(void)
{
    convert(HAL_I_X);
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
uint8_t mega_swap_byte(uint8_t out)
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
    mega_swap_byte(RTD_CONFIG_WRITE);
    mega_swap_byte(RTD_CONFIG);
    PORTA |= select;
}

uint16_t hal_rtd(uint8_t channel)
{
    uint8_t select = (uint8_t)(_BV(PA0) << channel);
    uint16_t code;
    PORTA &= (uint8_t)~select;
    mega_swap_byte(RTD_READ);
    code = (uint16_t)((uint16_t)mega_swap_byte(0) << 8);
    code |= mega_swap_byte(0);
    PORTA |= select;
    if (code == 0) {
        /* A short, or a converter that lost its supply for a moment and its settings with it. */
        configure_rtd(select);
    }
    return code;
}

int32_t hal_bridge(void)
{
    static int32_t latest = BRIDGE_DEAD;
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
    uint32_t now = mega_time_us();
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
        since = mega_time_us() - pulse_us[pump];
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

void mega_start_readings(void)
{
    /* 250 kHz: 52 us a conversion, and still 10 bits. */
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1);
    /* Encoder on both edges, tachometers on the falling one. */
    EICRA = _BV(ISC21) | _BV(ISC31);
    EICRB = _BV(ISC40) | _BV(ISC50);
    encoder_old = (uint8_t)((PINE >> 4) & 3u);
    EIMSK = _BV(INT2) | _BV(INT3) | _BV(INT4) | _BV(INT5);
    for (uint8_t channel = 0; channel < 4; channel++) {
        configure_rtd((uint8_t)(_BV(PA0) << channel));
    }
}
