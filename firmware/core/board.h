/* The board: samples on its own timer, supervises, applies, and talks to the host. One axis. */

#ifndef SMAD_BOARD_H
#define SMAD_BOARD_H

/* Starts everything: parameters, supervisor, session, sample timer. Outputs are off. */
void board_start(void);

/* Does what there is to do, then returns. Call it for ever, with hal_sleep in between. */
void board_poll(void);

#endif
