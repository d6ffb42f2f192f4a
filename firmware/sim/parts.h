/* The parts around the emulated chip; under the same licence as simavr_board.c. */

#ifndef SMAD_PARTS_H
#define SMAD_PARTS_H

#include "link.h"

#include "sim_avr.h"
#include "sim_irq.h"

#define MHZ 16u

avr_irq_t *parts_pin(avr_t *avr, char port, int number);

/* Connects everything to the pins. */
void parts_wire(avr_t *avr);

/* After a reset: timers are gone, and pins have to be shown anew. */
void parts_reset(void);

/* Shows on the pins what `in` says; the encoder moves during the first half of a step. */
void parts_show(const struct link_in *in, uint32_t dt_us);

/* What the DAC puts out, in mA. */
void parts_currents(uint16_t current_mA[2]);

/* Cycles of the longest sample since the last call, by the pin that is on during one. */
uint32_t parts_sample_cycles(void);

#endif
