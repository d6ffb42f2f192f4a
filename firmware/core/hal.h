/* What the core asks of a chip. A port is one file that has these functions, and main.c.
 *
 * Rules for a port: nothing here blocks for longer than a sample's conversions; reading never
 * fails, it gives the raw code that says so; outputs are off until the core sets them; and what
 * the reset leaves on the pins (inputs, pulled down on the board) means off as well. */

#ifndef SMAD_HAL_H
#define SMAD_HAL_H

#include <stdbool.h>
#include <stdint.h>

/* Tables that stay in flash where RAM has an address space of its own. */
#ifdef __AVR__
#define HAL_FLASH __flash
#else
#define HAL_FLASH
#endif

/* Time and sampling */

/* Microseconds since power-up; wraps. */
uint32_t hal_time_us(void);

/* Starts the sample timer, or changes its period from the next tick on. */
void hal_sample_timer(uint32_t period_us);

/* Returns true once for each tick; `t_us` is when it was. Ticks that were missed are not made
 * up for: a late call gets the latest one. */
bool hal_sample_due(uint32_t *t_us);

/* Waits until something happens: a byte, a tick, the end of a write. May return for nothing. */
void hal_sleep(void);

/* Serial port */

/* Returns the next byte received, -1 if none is there. */
int hal_serial_read(void);

/* Bytes that hal_serial_write takes at once. */
uint16_t hal_serial_room(void);

/* Queues bytes; never more than there is room for. */
void hal_serial_write(const uint8_t *data, uint16_t size);

/* Highest rate of samples, in Hz, that the chip has the time for; 0 for any. */
uint16_t hal_most_rate_hz(void);

/* Speed of the port in Bd; 0 for one without, such as USB. */
uint32_t hal_serial_baud(void);

/* Readings, as raw codes; convert.c says what they mean */

enum hal_analog {
    HAL_I_X, HAL_I_Y,   /* shunt amplifier, 1 V/A */
    HAL_V_X, HAL_V_Y,   /* voltage across the spring, divided by 3 */
    HAL_VBUS,           /* supply, divided by 4 */
    HAL_ANALOGS
};

/* Converts one channel: 0 to 1023 for 0 to 5 V. Asked for in rising order, with something else in
 * between, a port can convert the next one meanwhile. */
uint16_t hal_analog(enum hal_analog channel);

/* RTD register of converter 0 to 3 (spring X, spring Y, inlet, ambient), as MAX31865 has it:
 * the ratio to the reference resistor in bits 15 to 1, a fault in bit 0. */
uint16_t hal_rtd(uint8_t channel);

/* Latest conversion of the bridge, 24 bits with sign. */
int32_t hal_bridge(void);

/* Counts of the encoder since power-up, four for each period. */
int32_t hal_encoder(void);

/* Time between the last two pulses of a pump's tachometer, in us; 0 if it stands. */
uint32_t hal_tacho_us(uint8_t pump);

#define HAL_INPUT_LEAK 1u
#define HAL_INPUT_ENCODER_ALARM 2u

/* Contacts, as bits. */
uint8_t hal_inputs(void);

/* Outputs */

/* The switch in front of the drivers. */
void hal_gate(bool on);

/* Current asked of driver 0 (X) or 1 (Y); 4095 mA is the most a port can ask for. */
void hal_current(uint8_t driver, uint16_t i_mA);

/* Pump drive, 255 is full. */
void hal_pump(uint8_t pump, uint8_t duty);

/* Drain valves; bit 0 is X, bit 1 is Y. */
void hal_drain(uint8_t valves);

/* Store: bytes that survive a power cycle; 0xFF where nothing was written */

#define HAL_STORE_SIZE 1024u

uint8_t hal_store_read(uint16_t address);

/* Begins to write one byte; only while hal_store_busy is false. */
void hal_store_write(uint16_t address, uint8_t value);

bool hal_store_busy(void);

/* Watchdog and identity */

/* Puts off the watchdog, which resets the chip after 120 ms without this. */
void hal_watchdog_kick(void);

/* Why the chip started; enum smad_reset_cause. */
uint8_t hal_reset_cause(void);

/* Memory that a reset leaves as it is. After power-up it may hold anything. */
#define HAL_NOINIT 4u
extern volatile uint32_t hal_noinit[HAL_NOINIT];

/* Unique number of the chip. */
void hal_uid(uint8_t uid[12]);

/* A pin for an oscilloscope: on while a sample is taken and its STATE is written. */
void hal_mark(bool on);

/* Name of the port, for IDENT. */
extern const char hal_name[];

#endif
