/* The Mega's pins, and what the files of this port share. */

#ifndef SMAD_MEGA_H
#define SMAD_MEGA_H

#include <avr/io.h>
#include <stdbool.h>
#include <stdint.h>

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

/* The clock in us; with interrupts off. */
uint32_t mega_time_us(void);

/* Starts the converter of the analogue inputs on the first of them, at the tick of a sample. */
void mega_first_conversion(void);

/* One byte out to a converter or the DAC, and one in. */
uint8_t mega_swap_byte(uint8_t out);

/* Sets up the RTD converters, encoder and tachometers. */
void mega_start_readings(void);

/* Sets up the serial port. */
void mega_start_serial(void);

/* Whether a byte was received; with interrupts off. */
bool mega_received(void);

/* Lets the bytes go that were queued. Not sooner: the interrupts would lengthen the sample that
 * made them. */
void mega_send(void);

#endif
