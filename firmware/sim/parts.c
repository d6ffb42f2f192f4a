/* The parts of the wiring page, on the pins of the emulated chip; under the same licence as
 * simavr_board.c. */

#include "parts.h"

#include <stdbool.h>
#include <stdlib.h>

#include "avr_adc.h"
#include "avr_extint.h"
#include "avr_ioport.h"
#include "sim_cycle_timers.h"

#define SUPPLY_MV 5000u
#define ADC_TOP 1023u
#define LEAK 4
#define ENCODER_ALARM 7
#define BRIDGE_DATA 5
#define BRIDGE_CLOCK 6
#define BRIDGE_MOST 8388607 /* a reading beyond: nothing is plugged in */
#define DAC 4
#define EDGE_LEAST 640u /* cycles; 25 mm/s at a count of 1 um, beyond what the bench does */

static avr_t *avr;
static struct link_in shown;
static uint32_t longest_sample;

avr_irq_t *parts_pin(avr_t *chip, char port, int number)
{
    return avr_io_getirq(chip, AVR_IOCTL_IOPORT_GETIRQ(port), number);
}

/* Converters on the bit-banged bus: four MAX31865, one MCP4922, one HX711 */

static uint8_t selects = 0x1F;
static uint8_t mosi;
static uint8_t bits_in;
static uint32_t word_in;
static uint32_t word_out;
static uint16_t current_mA[2];
static uint32_t bridge_word;
static uint8_t bridge_bits;

static void on_select(struct avr_irq_t *irq, uint32_t value, void *which)
{
    uint8_t bit = (uint8_t)(1u << (uintptr_t)which);
    (void)irq;
    if (value == 0) {
        selects &= (uint8_t)~bit;
        bits_in = 0;
        word_in = 0;
        word_out = 0;
    } else {
        if ((selects & bit) == 0 && (uintptr_t)which == DAC && bits_in == 16) {
            bool active = (word_in & 0x1000u) != 0;
            current_mA[word_in >> 15 & 1u] = active ? (uint16_t)(word_in & 0x0FFFu) : 0;
        }
        selects |= bit;
    }
}

static void on_mosi(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)unused;
    mosi = (uint8_t)(value & 1u);
}

static void on_clock(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)unused;
    if (value == 0) {
        return;
    }
    word_in = word_in << 1 | mosi;
    bits_in++;
    avr_raise_irq(parts_pin(avr, 'B', 3), word_out >> 31);
    word_out <<= 1;
    if (bits_in == 8 && (word_in & 0xFFu) == 0x01u) {
        for (int k = 0; k < 4; k++) {
            if ((selects & 1u << k) == 0) {
                word_out = (uint32_t)shown.rtd[k] << 16;
            }
        }
    }
}

/* Against the pull-up of the chip, if there is a bridge. */
static void drive_bridge(uint32_t bit)
{
    bool plugged = shown.bridge <= BRIDGE_MOST;
    avr_ioport_external_t driven = {.name = 'A', .mask = (unsigned char)(plugged << BRIDGE_DATA),
                                    .value = (unsigned char)(bit << BRIDGE_DATA)};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('A'), &driven);
    if (plugged) {
        avr_raise_irq(parts_pin(avr, 'A', BRIDGE_DATA), bit);
    }
}

static void on_bridge_clock(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)unused;
    if (value == 0) {
        return;
    }
    if (bridge_bits == 0) {
        bridge_word = (uint32_t)shown.bridge << 8;
    }
    if (++bridge_bits == 25) {
        bridge_bits = 0;
        drive_bridge(0); /* the next conversion is there */
        return;
    }
    drive_bridge(bridge_word >> 31);
    bridge_word <<= 1;
}

/* The pin that is on while a sample is taken */

static avr_cycle_count_t mark_cycle;

static void on_mark(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq, (void)unused;
    if (value != 0) {
        mark_cycle = avr->cycle;
    } else if (avr->cycle - mark_cycle > longest_sample) {
        longest_sample = (uint32_t)(avr->cycle - mark_cycle);
    }
}

/* Encoder and tachometers */

static int32_t encoder_at;
static avr_cycle_count_t edge_cycles;

/* A leads on the way up: 00, 10, 11, 01. */
static const uint8_t A[4] = {0, 1, 1, 0};
static const uint8_t B[4] = {0, 0, 1, 1};

static void show_encoder(void)
{
    uint8_t phase = (uint8_t)((uint32_t)encoder_at & 3u);
    avr_raise_irq(parts_pin(avr, 'E', 4), A[phase]);
    avr_raise_irq(parts_pin(avr, 'E', 5), B[phase]);
}

/* The pull-ups that the chip switches on at its start do not lift what the encoder drives. */
static void hold_encoder(void)
{
    uint8_t phase = (uint8_t)((uint32_t)encoder_at & 3u);
    avr_ioport_external_t driven = {.name = 'E', .mask = 3u << 4,
                                    .value = (A[phase] | B[phase] << 1) << 4};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('E'), &driven);
}

static avr_cycle_count_t on_edge(avr_t *chip, avr_cycle_count_t when, void *unused)
{
    (void)chip, (void)unused;
    if (encoder_at == shown.encoder) {
        return 0;
    }
    encoder_at += encoder_at < shown.encoder ? 1 : -1;
    show_encoder();
    return encoder_at == shown.encoder ? 0 : when + edge_cycles;
}

static bool turning[2];
static uint8_t pulse[2];

static avr_cycle_count_t on_pulse(avr_t *chip, avr_cycle_count_t when, void *which)
{
    uintptr_t pump = (uintptr_t)which;
    (void)chip;
    if (shown.tacho_us[pump] == 0) {
        turning[pump] = false;
        return 0;
    }
    pulse[pump] ^= 1u;
    avr_raise_irq(parts_pin(avr, 'D', pump == 0 ? 3 : 2), pulse[pump]);
    /* Every other edge counts. */
    return when + (avr_cycle_count_t)shown.tacho_us[pump] * MHZ / 2u;
}

void parts_show(const struct link_in *in, uint32_t dt_us)
{
    int32_t edges = abs(in->encoder - encoder_at);
    shown = *in;
    for (int k = 0; k < 5; k++) {
        avr_irq_t *adc = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + k);
        /* In millivolts, the least that gives this code. */
        avr_raise_irq(adc, (shown.analog[k] * SUPPLY_MV + ADC_TOP - 1u) / ADC_TOP);
    }
    avr_raise_irq(parts_pin(avr, 'C', LEAK), (shown.inputs & 1u) == 0);
    avr_raise_irq(parts_pin(avr, 'A', ENCODER_ALARM), (shown.inputs & 2u) == 0);
    if (edges > 0) {
        edge_cycles = (avr_cycle_count_t)dt_us * MHZ / 2u / (uint32_t)edges;
        edge_cycles = edge_cycles < EDGE_LEAST ? EDGE_LEAST : edge_cycles;
        avr_cycle_timer_cancel(avr, on_edge, NULL);
        avr_cycle_timer_register(avr, edge_cycles, on_edge, NULL);
    }
    for (uintptr_t k = 0; k < 2; k++) {
        avr_cycle_count_t half = (avr_cycle_count_t)shown.tacho_us[k] * MHZ / 2u;
        /* A pump that speeds up does not wait for the pulse of its slow time. */
        bool late = turning[k] && avr_cycle_timer_status(avr, on_pulse, (void *)k) > half;
        if (half != 0 && (late || !turning[k])) {
            turning[k] = true;
            avr_cycle_timer_cancel(avr, on_pulse, (void *)k);
            avr_cycle_timer_register(avr, half, on_pulse, (void *)k);
        }
    }
}

void parts_reset(void)
{
    turning[0] = turning[1] = false;
    selects = 0x1F;
    bridge_bits = 0;
    for (uint8_t k = 0; k < 8; k++) {
        avr_extint_set_strict_lvl_trig(avr, k, 0);
    }
    drive_bridge(0);
    /* The reset forgot these levels; what stays equal would not be raised again. */
    avr_raise_irq(parts_pin(avr, 'C', LEAK), 0);
    avr_raise_irq(parts_pin(avr, 'A', ENCODER_ALARM), 0);
    hold_encoder();
    show_encoder();
}

void parts_wire(avr_t *chip)
{
    avr = chip;
    for (uintptr_t k = 0; k < 5; k++) {
        avr_irq_register_notify(parts_pin(avr, 'A', (int)k), on_select, (void *)k);
    }
    avr_irq_register_notify(parts_pin(avr, 'A', BRIDGE_CLOCK), on_bridge_clock, NULL);
    avr_irq_register_notify(parts_pin(avr, 'B', 1), on_clock, NULL);
    avr_irq_register_notify(parts_pin(avr, 'B', 2), on_mosi, NULL);
    avr_irq_register_notify(parts_pin(avr, 'B', 7), on_mark, NULL);
}

void parts_currents(uint16_t wanted_mA[2])
{
    wanted_mA[0] = current_mA[0];
    wanted_mA[1] = current_mA[1];
}

uint32_t parts_sample_cycles(void)
{
    uint32_t cycles = longest_sample;
    longest_sample = 0;
    return cycles;
}
