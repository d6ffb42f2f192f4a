/* Parameters: the values in use, and two slots of the store that keep them through a power cut.
 *
 * A slot is: mark u8 | sequence u32 | size u16 | entries | crc32 u32. Entries are
 * `axis u8, number u16, value i32`, as in docs/protocol.md, of every value that is not the initial
 * one; the CRC covers all between mark and itself. A write takes the mark away first and sets it
 * last, so one that was cut off leaves a slot without a mark, and the other slot counts. A slot
 * with a mark and a wrong CRC is damage, and the board says so; one with another mark and a right
 * CRC counts, too. */

#ifndef SMAD_PARAMS_H
#define SMAD_PARAMS_H

#include "smad_protocol.h"
#include "smad_supervisor.h"

#define PARAM_STATE_RATE_HZ 1u

/* Reads the store. Returns false if it is damaged: then the initial values are in use. */
bool params_load(void);

/* Counts this start in the store and returns the number of starts so far. */
uint32_t params_count_boot(void);

/* Returns a value; 0 for a number that does not exist. */
int32_t params_get(uint16_t number);

/* CRC-32 of all values. */
uint32_t params_crc(void);

/* Fills in PARAM_VALUE. Returns false if there is no such parameter. */
bool params_describe(uint16_t number, struct smad_param_value *out);

/* Changes a value. Returns 0, or the error code with value and limit filled in. */
uint8_t params_set(uint16_t number, int32_t value, int32_t *limit);

/* Puts the stored limits in force, each as tight as its parameter says. */
void params_tighten(struct smad_sv_limits *limits);

/* Begins to write the values to the older slot. */
void params_save(void);

enum params_saving { SAVING_IDLE, SAVING_GOES_ON, SAVING_DONE, SAVING_FAILED };

/* Whether a write is going on. */
bool params_saving(void);

/* Carries the write on by one byte at most. Says once how it ended. */
enum params_saving params_poll(void);

#endif
