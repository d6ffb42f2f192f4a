/* The board's end of a session, as firmware_protocol/board.py has it.
 *
 * Bytes go in with session_byte. What the session knows it answers by itself (HELLO, DESCRIBE,
 * TIME_REQUEST, FAULT_GET); what the board decides it asks for through the board_on_... functions,
 * which answer with session_done, session_refuse or session_reply. Bytes never do harm: what is
 * wrong with them is counted. */

#ifndef SMAD_SESSION_H
#define SMAD_SESSION_H

#include "smad_protocol.h"

/* Starts with nobody connected and announces the board: IDENT with session 0. */
void session_boot(uint32_t boot_count, uint8_t reset_cause, int64_t now_us);

/* Takes in one byte received at `now_us`. */
void session_byte(uint8_t byte, int64_t now_us);

/* Puts a sample in the slot; one that was not sent yet is replaced. */
void session_send_state(const struct smad_state *state);

/* Keeps a fault, sends it now and with the next two samples. Fills in its index. */
void session_send_fault(struct smad_fault_report *report, int64_t now_us);

void session_send_stats(uint32_t overruns, uint32_t longest_loop_us, int64_t now_us);

/* Writes the sample that waits, if the line has room for it. */
void session_flush(int64_t now_us);

/* Answers to the request that is being handled or still open. */
void session_reply(uint8_t number, const uint8_t *payload, uint8_t size, int64_t now_us);
void session_done(int64_t now_us);
void session_refuse(uint8_t code, uint8_t field, int64_t value, int64_t limit, int64_t now_us);

/* Tells the host of the setpoint being handled that it is not taken: the field and its limit. */
void session_refuse_setpoint(uint8_t code, uint8_t field, int64_t value, int64_t limit,
                             int64_t now_us);

bool session_is_open(void);

/* Mode that the latest sample told. */
uint8_t session_last_mode(void);

bool session_schema_agrees(void);

/* What fits the wire of what the supervisor counts in more bits. */
int32_t saturated(int64_t value);

/* What the board decides */

void board_on_session(int64_t now_us);
void board_on_setpoint(const struct smad_setpoint *setpoint, uint8_t seq, uint16_t age_us,
                       int64_t now_us);
void board_on_arm_request(uint32_t param_crc, int64_t now_us);
void board_on_arm_confirm(uint32_t token, int64_t now_us);
void board_on_disarm(int64_t now_us);
void board_on_clear_fault(uint8_t fault, int64_t now_us);
void board_on_param_get(uint16_t param, int64_t now_us);
void board_on_param_set(uint16_t param, int32_t value, int64_t now_us);
void board_on_param_save(int64_t now_us);
void board_on_estop(int64_t now_us);

#endif
