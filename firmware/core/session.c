#include "session.h"

#include "hal.h"
#include "inbox.h"
#include "line.h"
#include "params.h"
#include "reports.h"

#include <string.h>

#define AXES 1u
#define SLICE sizeof(((struct smad_description *)0)->data)

#define CAPABILITIES                                                                     \
    (SMAD_CAPABILITY_ENCODER | SMAD_CAPABILITY_FORCE_SENSOR | SMAD_CAPABILITY_VOLTAGE_SENSE \
     | SMAD_CAPABILITY_RTD_INLET | SMAD_CAPABILITY_RTD_AMBIENT | SMAD_CAPABILITY_DRAIN      \
     | SMAD_CAPABILITY_LEAK_SENSOR | SMAD_CAPABILITY_PUMP_TACHO                             \
     | SMAD_CAPABILITY_PARAMETER_STORE)

static struct smad_decoder decoder;
static struct smad_frame frame;
static struct {
    uint32_t payload_errors;
    uint32_t session_errors;
    uint32_t stale_setpoints;
    uint32_t repeated_requests;
    uint32_t dropped_states;
} counts;

static uint32_t boots;
static uint8_t cause;
static uint16_t session;
static uint32_t nonce;
static bool schema_agrees;

/* The last request of this session, and the frame it was answered with. */
static uint8_t request_type;
static uint8_t request_seq;
static bool answered;
static uint8_t answer[SMAD_MAX_WIRE];
static uint8_t answer_size;

static struct smad_setpoint_gate gate;

/* The last fault as it went on the line, for its copies. */
static uint8_t fault_wire[SMAD_MAX_WIRE];
static uint8_t fault_wire_size;
static uint8_t fault_wire_index;
static uint16_t fault_wire_session;

static bool state_waits;
static struct smad_state waiting;
static uint8_t last_mode;
static uint8_t state_seq;
static uint8_t stats_seq;

int32_t saturated(int64_t value)
{
    if (value > INT32_MAX) {
        return INT32_MAX;
    }
    return value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

bool session_is_open(void)
{
    return session != 0;
}

bool session_schema_agrees(void)
{
    return schema_agrees;
}

/* Writing */

static void send(uint8_t number, uint8_t seq, uint16_t in_session, const uint8_t *payload,
                 uint8_t size, int64_t now_us)
{
    uint8_t wire[SMAD_MAX_WIRE];
    line_put(wire, (uint16_t)smad_frame_encode(number, seq, in_session, payload, size, wire), now_us);
}

static void send_ident(uint16_t in_session, uint32_t echoed, uint8_t seq, int64_t now_us)
{
    struct smad_ident ident;
    uint8_t payload[SMAD_IDENT_SIZE];
    memset(&ident, 0, sizeof ident);
    ident.major = SMAD_PROTOCOL_MAJOR;
    ident.minor = SMAD_PROTOCOL_MINOR;
    ident.schema_crc = SMAD_SCHEMA_CRC;
    ident.param_crc = params_crc();
    ident.nonce = echoed;
    ident.session = in_session;
    ident.boot_count = boots;
    ident.reset_cause = cause;
    ident.first_fault = reports_first_fault();
    ident.axes = AXES;
    ident.capabilities = CAPABILITIES;
    ident.state_rate_hz = (uint16_t)params_get(PARAM_STATE_RATE_HZ);
    ident.baud = hal_serial_baud();
    hal_uid(ident.uid);
    for (uint8_t i = 0; i < sizeof ident.firmware && hal_name[i] != 0; i++) {
        ident.firmware[i] = hal_name[i];
    }
    smad_pack_ident(&ident, payload);
    send(SMAD_IDENT_NUMBER, seq, in_session, payload, sizeof payload, now_us);
}

void session_reply(uint8_t number, const uint8_t *payload, uint8_t size, int64_t now_us)
{
    if (answered) {
        return;
    }
    answer_size = (uint8_t)smad_frame_encode(number, request_seq, session, payload, size, answer);
    answered = true;
    line_put(answer, answer_size, now_us);
}

void session_done(int64_t now_us)
{
    struct smad_done done;
    uint8_t payload[SMAD_DONE_SIZE];
    done.request_type = request_type;
    done.t_us = (uint32_t)now_us;
    smad_pack_done(&done, payload);
    session_reply(SMAD_DONE_NUMBER, payload, sizeof payload, now_us);
}

static void pack_error(uint8_t payload[SMAD_ERROR_SIZE], uint8_t type, uint8_t seq, uint8_t code,
                       uint8_t field, int64_t value, int64_t limit)
{
    struct smad_error error;
    error.request_type = type;
    error.request_seq = seq;
    error.code = code;
    error.field = field;
    error.value = saturated(value);
    error.limit = saturated(limit);
    smad_pack_error(&error, payload);
}

void session_refuse(uint8_t code, uint8_t field, int64_t value, int64_t limit, int64_t now_us)
{
    uint8_t payload[SMAD_ERROR_SIZE];
    pack_error(payload, request_type, request_seq, code, field, value, limit);
    session_reply(SMAD_ERROR_NUMBER, payload, sizeof payload, now_us);
}

/* Answers what is no request, at most ten times a second: a flood must not fill the line back. */
static void complain(uint8_t code, uint8_t field, int32_t value, int32_t limit, int64_t now_us)
{
    uint8_t payload[SMAD_ERROR_SIZE];
    if (!line_may_complain(now_us)) {
        return;
    }
    pack_error(payload, frame.type, frame.seq, code, field, value, limit);
    send(SMAD_ERROR_NUMBER, frame.seq, session, payload, sizeof payload, now_us);
}

void session_send_state(const struct smad_state *state)
{
    if (state_waits) {
        counts.dropped_states++;
    }
    waiting = *state;
    if ((waiting.valid & SMAD_VALID_BIT_SETPOINT) && !gate.passed) {
        /* The setpoint in use came from an earlier session: its number means nothing now. */
        waiting.valid &= (uint16_t)~SMAD_VALID_BIT_SETPOINT;
        waiting.sp_seq = 0;
        waiting.sp_age_us = SMAD_INVALID_U16;
    }
    last_mode = waiting.mode;
    state_waits = true;
}

static void put_fault(const uint8_t *payload, int64_t now_us)
{
    uint8_t index = payload[1];
    if (fault_wire_size == 0 || fault_wire_index != index || fault_wire_session != session) {
        fault_wire_index = index;
        fault_wire_session = session;
        fault_wire_size = (uint8_t)smad_frame_encode(SMAD_FAULT_REPORT_NUMBER, index, session,
                                                     payload, SMAD_FAULT_REPORT_SIZE, fault_wire);
    }
    line_put(fault_wire, fault_wire_size, now_us);
}

void session_send_fault(struct smad_fault_report *report, int64_t now_us)
{
    fault_wire_size = 0;
    put_fault(reports_add(report), now_us);
}

void session_send_stats(uint32_t overruns, uint32_t longest_loop_us, int64_t now_us)
{
    struct smad_link_stats stats;
    uint8_t payload[SMAD_LINK_STATS_SIZE];
    stats.frames = decoder.frames;
    stats.crc_errors = decoder.crc_errors;
    stats.cobs_errors = decoder.cobs_errors;
    stats.length_errors = decoder.length_errors;
    stats.payload_errors = counts.payload_errors;
    stats.session_errors = counts.session_errors;
    stats.stale_setpoints = counts.stale_setpoints;
    stats.repeated_requests = counts.repeated_requests;
    stats.dropped_states = counts.dropped_states;
    stats.overruns = overruns;
    stats.longest_loop_us = longest_loop_us;
    smad_pack_link_stats(&stats, payload);
    send(SMAD_LINK_STATS_NUMBER, ++stats_seq, session, payload, sizeof payload, now_us);
}

void session_flush(int64_t now_us)
{
    uint8_t payload[SMAD_STATE_SIZE];
    const uint8_t *report;
    if (!state_waits || hal_serial_room() < SMAD_STATE_SIZE + 11u) {
        return;
    }
    smad_pack_state(&waiting, payload);
    state_waits = false;
    send(SMAD_STATE_NUMBER, ++state_seq, session, payload, sizeof payload, now_us);
    while ((report = reports_repeat()) != NULL) {
        put_fault(report, now_us);
    }
}

/* Frames */

static void on_hello(const struct smad_hello *hello, int64_t now_us)
{
    if (hello->major != SMAD_PROTOCOL_MAJOR) {
        send_ident(0, hello->nonce, frame.seq, now_us);
        return;
    }
    if (session == 0 || hello->nonce != nonce) {
        /* A number comes again after 65 535 sessions. Bytes arrive in order, so no frame of that
         * earlier session can still be on its way. */
        session = (uint16_t)((session == 0 ? boots * 257u + 1u : session) % 0xFFFFu + 1u);
        nonce = hello->nonce;
        schema_agrees = hello->schema_crc == SMAD_SCHEMA_CRC;
        request_seq = 0;
        answered = true;
        answer_size = 0;
        memset(&gate, 0, sizeof gate);
        send_ident(session, hello->nonce, frame.seq, now_us);
        board_on_session(now_us);
        return;
    }
    send_ident(session, hello->nonce, frame.seq, now_us);
}

static void on_setpoint(const struct smad_setpoint *setpoint, int64_t now_us)
{
    int64_t age_us;
    if (setpoint->axis >= AXES) {
        complain(SMAD_ERROR_CODE_NO_SUCH_AXIS, 0, setpoint->axis, AXES - 1u, now_us);
        return;
    }
    age_us = smad_setpoint_gate_admit(&gate, setpoint->t_ref_us, frame.seq, now_us);
    if (age_us < 0) {
        counts.stale_setpoints++;
        return;
    }
    board_on_setpoint(setpoint, frame.seq, (uint16_t)age_us, now_us);
}

void session_refuse_setpoint(uint8_t code, uint8_t field, int64_t value, int64_t limit,
                             int64_t now_us)
{
    complain(code, field, saturated(value), saturated(limit), now_us);
}

static void on_describe(uint16_t offset, int64_t now_us)
{
    struct smad_description description;
    uint8_t payload[SMAD_DESCRIPTION_SIZE];
    memset(&description, 0, sizeof description);
    description.offset = offset;
    description.total = SMAD_SCHEMA_SIZE;
    for (uint8_t i = 0; i < SLICE && (uint32_t)offset + i < SMAD_SCHEMA_SIZE; i++) {
        description.data[i] = smad_schema[offset + i];
        description.size++;
    }
    smad_pack_description(&description, payload);
    session_reply(SMAD_DESCRIPTION_NUMBER, payload, sizeof payload, now_us);
}

static void on_fault_get(uint8_t index, int64_t now_us)
{
    const uint8_t *report = reports_get(index);
    if (report == NULL) {
        session_refuse(SMAD_ERROR_CODE_NO_SUCH_REPORT, 1, index, reports_count(), now_us);
        return;
    }
    session_reply(SMAD_FAULT_REPORT_NUMBER, report, SMAD_FAULT_REPORT_SIZE, now_us);
}

static void on_time(uint32_t t1_us, int64_t now_us)
{
    struct smad_time_reply reply;
    uint8_t payload[SMAD_TIME_REPLY_SIZE];
    reply.t1_us = t1_us;
    reply.t2_us = (uint32_t)now_us;
    reply.t3_us = (uint32_t)now_us;
    smad_pack_time_reply(&reply, payload);
    send(SMAD_TIME_REPLY_NUMBER, frame.seq, session, payload, sizeof payload, now_us);
}

static void carry_out(const union message *m, int64_t now_us)
{
    switch (frame.type) {
    case SMAD_DESCRIBE_NUMBER:
        on_describe(m->describe.offset, now_us);
        break;
    case SMAD_ARM_REQUEST_NUMBER:
        board_on_arm_request(m->arm_request.param_crc, now_us);
        break;
    case SMAD_ARM_CONFIRM_NUMBER:
        board_on_arm_confirm(m->arm_confirm.token, now_us);
        break;
    case SMAD_DISARM_NUMBER:
        board_on_disarm(now_us);
        break;
    case SMAD_CLEAR_FAULT_NUMBER:
        board_on_clear_fault(m->clear_fault.fault, now_us);
        break;
    case SMAD_FAULT_GET_NUMBER:
        on_fault_get(m->fault_get.index, now_us);
        break;
    case SMAD_PARAM_GET_NUMBER:
        board_on_param_get(m->param_get.param, now_us);
        break;
    case SMAD_PARAM_SET_NUMBER:
        board_on_param_set(m->param_set.param, m->param_set.value, now_us);
        break;
    case SMAD_PARAM_SAVE_NUMBER:
        board_on_param_save(now_us);
        break;
    default:
        session_refuse(SMAD_ERROR_CODE_UNKNOWN_TYPE, 0, frame.type, 0, now_us);
        break;
    }
}

/* Carries a request out at most once: the same number again gets the same answer again. */
static void on_request(const union message *m, int64_t now_us)
{
    uint8_t step = (uint8_t)(frame.seq - request_seq);
    uint8_t axis = inbox_axis(&frame);
    if (step == 0 && answered) {
        counts.repeated_requests++;
        if (answer_size > 0) {
            line_put(answer, answer_size, now_us);
        }
        return;
    }
    if (step > 127) {
        counts.repeated_requests++;
        return;
    }
    if (!answered && frame.type != SMAD_DISARM_NUMBER) {
        return;
    }
    /* DISARM does not wait for a save. The host asks again for what it overtook. */
    request_type = frame.type;
    request_seq = frame.seq;
    answered = false;
    if (axis >= AXES) {
        session_refuse(SMAD_ERROR_CODE_NO_SUCH_AXIS, 0, axis, AXES - 1u, now_us);
        return;
    }
    carry_out(m, now_us);
}

static void on_frame(int64_t now_us)
{
    union message m;
    enum reading reading;
    if (frame.type >= 0x80u) {
        return; /* an echo */
    }
    reading = inbox_read(&frame, &m);
    if (reading != READ_GOOD) {
        bool known = reading == READ_BAD;
        counts.payload_errors++;
        complain(known ? SMAD_ERROR_CODE_BAD_PAYLOAD : SMAD_ERROR_CODE_UNKNOWN_TYPE, SMAD_NO_FIELD,
                 frame.size, 0, now_us);
    } else if (frame.type == SMAD_ESTOP_NUMBER) {
        board_on_estop(now_us);
    } else if (frame.type == SMAD_HELLO_NUMBER) {
        on_hello(&m.hello, now_us);
    } else if (session == 0 || frame.session != session) {
        counts.session_errors++;
        complain(SMAD_ERROR_CODE_NO_SESSION, SMAD_NO_FIELD, frame.session, session, now_us);
    } else if (!schema_agrees && frame.type != SMAD_DESCRIBE_NUMBER) {
        complain(SMAD_ERROR_CODE_SCHEMA_DIFFERS, SMAD_NO_FIELD, 0, 0, now_us);
    } else if (frame.type == SMAD_TIME_REQUEST_NUMBER) {
        on_time(m.time_request.t1_us, now_us);
    } else if (frame.type == SMAD_SETPOINT_NUMBER) {
        on_setpoint(&m.setpoint, now_us);
    } else {
        on_request(&m, now_us);
    }
}

void session_byte(uint8_t byte, int64_t now_us)
{
    if (smad_decoder_byte(&decoder, byte, &frame)) {
        on_frame(now_us);
    }
}

void session_boot(uint32_t boot_count, uint8_t reset_cause, int64_t now_us)
{
    smad_decoder_init(&decoder);
    boots = boot_count;
    cause = reset_cause;
    answered = true;
    send_ident(0, 0, 0, now_us);
}

uint8_t session_last_mode(void)
{
    return last_mode;
}
