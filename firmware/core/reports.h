/* The board's memory of its faults: the first since power-up, and the last fifteen. */

#ifndef SMAD_REPORTS_H
#define SMAD_REPORTS_H

#include "smad_protocol.h"

/* Keeps a report; fills in its index and returns it packed. */
const uint8_t *reports_add(struct smad_fault_report *report);

/* Returns the next report of which a copy goes with the sample now being sent, NULL after the
 * last one. */
const uint8_t *reports_repeat(void);

/* Returns a packed report, NULL if there is none (any more). */
const uint8_t *reports_get(uint8_t index);

/* How many were made since power-up. */
uint16_t reports_count(void);

/* Fault of the first report, 0 for none. */
uint8_t reports_first_fault(void);

#endif
