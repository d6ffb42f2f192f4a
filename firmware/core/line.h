/* Frames on their way out, and how many complaints are allowed. */

#ifndef SMAD_LINE_H
#define SMAD_LINE_H

#include <stdbool.h>
#include <stdint.h>

/* Writes a frame, after a delimiter if the line was silent for long. Where there is no room it is
 * dropped: an answer is asked for again, a sample is followed by the next. */
void line_put(const uint8_t *wire, uint16_t size, int64_t now_us);

/* Whether one more ERROR that answers no request is allowed: ten a second, whatever arrives. */
bool line_may_complain(int64_t now_us);

#endif
