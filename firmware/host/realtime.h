/* The host port by itself: a pseudo-terminal and the computer's clock in place of the link. */

#ifndef SMAD_REALTIME_H
#define SMAD_REALTIME_H

#include "link.h"

/* Opens a pseudo-terminal, gives it the lasting name `symlink`, and prints "ready" and its path. */
void realtime_open(const char *symlink);

/* Writes what the board sent, waits for bytes or for `wait_us` to pass, and fills in how long that
 * was, the bytes, and what the converters show. */
void realtime_step(const struct link_out *out, const uint8_t *sent, struct link_to_board *in,
                   uint64_t wait_us);

#endif
