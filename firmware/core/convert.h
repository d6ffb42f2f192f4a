/* Raw codes to the units of the wire. What the codes mean is fixed by the parts on the wiring
 * page: shunt amplifiers, dividers, 430 ohm reference resistors, Pt100. */

#ifndef SMAD_CONVERT_H
#define SMAD_CONVERT_H

#include <stdbool.h>
#include <stdint.h>

#define BRIDGE_MOST 8388607
#define BRIDGE_LEAST (-8388607 - 1)

/* Full scale of the converter's 5 V in mA and mV. */
#define CONVERT_CURRENT_MA 5000u
#define CONVERT_SPRING_MV 15000u
#define CONVERT_SUPPLY_MV 20000u

/* Code 0 to 1023 of a channel whose full scale is `full`, rounded. */
uint16_t convert_analog(uint16_t code, uint16_t full);

/* RTD register to cC; the supervisor's "no value" (-32768) for a converter that reports a fault
 * or does not answer. Full scale reads as open, zero as short, as the supervisor's rails want. */
int16_t convert_rtd(uint16_t rtd_register);

/* Time between two tachometer pulses to revolutions a minute, two pulses each. */
uint16_t convert_tacho(uint32_t period_us);

/* Whether the bridge is inside its range. */
bool convert_bridge_valid(int32_t code);

#endif
