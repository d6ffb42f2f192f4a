/* What the files of this port share. */

#ifndef SMAD_NUCLEO_H
#define SMAD_NUCLEO_H

void nucleo_start_clock(void);
void nucleo_start_pins(void);
void nucleo_start_timers(void);

#endif
