#include "board.h"

#include "hal.h"
#include "params.h"
#include "sample.h"
#include "session.h"
#include "smad_supervisor.h"

#include <string.h>

#define SELF_TEST_SAMPLES 5u
#define STATS_EVERY_US 1000000
#define AGE_MOST_US 0xFFFEu
#define BYTES_A_TURN 32u /* a line full of noise must not keep the loop from its samples */
#define LINK_SESSION 1
#define LINK_SCHEMA 2
#define LINK_PARAMETERS 4
#define LINK_CLOCK 8
#define STAGE_FIELD 6u /* of SETPOINT */
#define LATCHED_ESTOP 0x10000u
#define PARAM_CRC_BIT (1ul << (SMAD_FAULT_PARAM_CRC - 1))

static struct smad_sv_memory sv;
static struct sample now;
static struct smad_sv_limits limits;

static int64_t now_us;
static uint32_t last_time_us;
static uint32_t period_us;

static uint8_t drain;

static bool fault_reported;
static int64_t stats_due_us;
static uint32_t overruns;
static uint32_t longest_loop_us;

static bool save_again;
static bool crc_agreed;
static uint32_t agreed_crc;
static uint32_t token_state;

/* Time since power-up in full, from the chip's 32 bits. */
static int64_t full_time(uint32_t t_us)
{
    int32_t step_us = (int32_t)(t_us - last_time_us);
    if (step_us > 0) {
        last_time_us = t_us;
        now_us += step_us;
        return now_us;
    }
    return now_us + step_us;
}

static int64_t time_now(void)
{
    return full_time(hal_time_us());
}

/* Outputs */

/* The gate goes first on the way off and last on the way on. */
static void apply(void)
{
    if (!sv.gate) {
        hal_gate(false);
        drain = 0;
    }
    for (uint8_t k = 0; k < 2; k++) {
        hal_current(k, (uint16_t)sv.applied_mA[k]);
        hal_pump(k, (uint8_t)sv.duty[k]);
    }
    hal_drain(drain);
    if (sv.gate) {
        hal_gate(true);
    }
}

static void report_fault_with(const struct smad_state *state)
{
    if (sv.latched && !fault_reported) {
        struct smad_fault_report report;
        report.axis = 0;
        report.fault = (uint8_t)sv.first_fault;
        report.channel = (uint8_t)sv.first_channel;
        report.t_us = (uint32_t)sv.first_us;
        report.measured = saturated(sv.first_value);
        report.limit = saturated(sv.first_limit);
        report.snapshot = *state;
        session_send_fault(&report, now_us);
    }
    fault_reported = sv.latched != 0;
}

/* Of hal_noinit: first fault (channel from bit 8, ESTOP at bit 16), value, limit, and this check. */
static uint32_t check_of_latched(void)
{
    return ~(hal_noinit[0] + hal_noinit[1] + hal_noinit[2]);
}

static void save_latched(void)
{
    uint32_t first = 0;
    if (sv.latched) {
        first = sv.first_fault | (uint32_t)sv.first_channel << 8;
        first |= sv.state == SMAD_BOARD_STATE_ESTOP ? LATCHED_ESTOP : 0;
    }
    if (hal_noinit[0] != first) {
        hal_noinit[0] = first;
        hal_noinit[1] = (uint32_t)sv.first_value;
        hal_noinit[2] = (uint32_t)sv.first_limit;
        hal_noinit[3] = check_of_latched();
    }
}

/* RAM may outlive a short time without power: then nothing is taken over. */
static void restore_latched(void)
{
    struct smad_sv_command command;
    uint32_t first = hal_noinit[0];
    if (first != 0 && hal_noinit[3] == check_of_latched()
        && hal_reset_cause() != SMAD_RESET_CAUSE_POWER_ON) {
        memset(&command, 0, sizeof command);
        command.fault = (uint8_t)first;
        sv.channel = (uint8_t)(first >> 8);
        sv.value = (int32_t)hal_noinit[1];
        sv.limit = (int32_t)hal_noinit[2];
        smad_sv_on_restart(&sv, &command);
        if ((first & LATCHED_ESTOP) != 0) {
            smad_sv_on_estop(&sv, &limits);
        }
    }
    save_latched();
}

static void report_fault(void)
{
    struct smad_state state;
    save_latched();
    if (!sv.started) {
        return; /* the first sample reports it, with its readings */
    }
    if (sv.latched && !fault_reported) {
        sample_tell(&now, &sv, &state);
    }
    report_fault_with(&state);
}

/* Sampling */

static void watch_loop(uint32_t dt_us)
{
    if (dt_us > longest_loop_us) {
        longest_loop_us = dt_us;
    }
    if (dt_us > period_us + period_us / 2u && now.tick > 1) {
        overruns++;
    }
}

static void pass_self_test(void)
{
    struct smad_sv_command command;
    memset(&command, 0, sizeof command);
    command.passed = 1;
    smad_sv_on_self_test(&sv, &limits, &command);
}

static void take_sample(uint32_t t_us)
{
    struct smad_state state;
    int64_t at_us = full_time(t_us);
    uint32_t dt_us = (uint32_t)(at_us - now.t_us);
    now.t_us = at_us;
    sample_read(&now, &sv);
    now.tick++;
    if (sv.state == SMAD_BOARD_STATE_BOOT && now.tick >= SELF_TEST_SAMPLES) {
        pass_self_test();
    }
    smad_sv_sample(&sv, &now.measured, &limits, at_us);
    apply();
    save_latched();
    hal_watchdog_kick();
    watch_loop(dt_us);
    sample_tell(&now, &sv, &state);
    session_send_state(&state);
    if (fault_reported != (sv.latched != 0)) {
        report_fault_with(&state);
    } else if (at_us >= stats_due_us) {
        /* Not in the sample of a fault, which is the longest as it is. */
        stats_due_us += STATS_EVERY_US;
        session_send_stats(overruns, longest_loop_us, at_us);
        longest_loop_us = 0;
    }
}

/* Commands of the host */

static int link_word(void)
{
    int word = session_is_open() ? LINK_SESSION : 0;
    word |= session_schema_agrees() ? LINK_SCHEMA : 0;
    word |= crc_agreed && agreed_crc == params_crc() ? LINK_PARAMETERS : 0;
    word |= (uint32_t)sv.dt_us <= 2u * period_us ? LINK_CLOCK : 0;
    return word;
}

/* Answers a request with what the supervisor said. */
static void answer(uint8_t code, int64_t at_us)
{
    apply();
    report_fault();
    if (code != 0) {
        session_refuse(code, (uint8_t)sv.channel, sv.value, sv.limit, at_us);
    }
}

/* Tokens need not be secret, only different each time: xorshift32, never 0. */
static uint32_t new_token(int64_t at_us)
{
    token_state ^= (uint32_t)at_us;
    token_state = token_state != 0 ? token_state : 0x9E3779B9u;
    token_state ^= token_state << 13;
    token_state ^= token_state >> 17;
    token_state ^= token_state << 5;
    return token_state;
}

void board_on_session(int64_t at_us)
{
    (void)at_us;
    /* A host that comes back must arm again; one that took over never armed at all. */
    smad_sv_on_disarm(&sv, &limits);
    apply();
    report_fault();
}

void board_on_setpoint(const struct smad_setpoint *setpoint, uint8_t seq, uint16_t age_us,
                       int64_t at_us)
{
    struct smad_sv_command command;
    uint8_t code;
    memset(&command, 0, sizeof command);
    for (uint8_t k = 0; k < 2; k++) {
        command.i_mA[k] = setpoint->i_mA[k];
        command.duty[k] = setpoint->pump_duty[k];
    }
    command.age_us = age_us;
    command.ttl_us = (int32_t)setpoint->ttl_ms * 1000;
    command.stage_um = (setpoint->flags & SMAD_SETPOINT_FLAG_STAGE) != 0 ? setpoint->stage_um : 0;
    code = (uint8_t)smad_sv_on_setpoint(&sv, &limits, &command, at_us);
    if (code == SMAD_ERROR_CODE_OUT_OF_RANGE) {
        /* Not armed, or too old: STATE tells. That a stage does not go so far, nothing else. */
        session_refuse_setpoint(code, STAGE_FIELD, command.stage_um, sv.limit, at_us);
    }
    if (code != 0) {
        return;
    }
    now.sp_seq = seq;
    now.sp_age_us = age_us < AGE_MOST_US ? age_us : AGE_MOST_US;
    drain = setpoint->flags & (SMAD_SETPOINT_FLAG_DRAIN_X | SMAD_SETPOINT_FLAG_DRAIN_Y);
    apply();
}

void board_on_arm_request(uint32_t param_crc, int64_t at_us)
{
    struct smad_sv_command command;
    uint8_t code;
    if (param_crc != params_crc()) {
        session_refuse(SMAD_ERROR_CODE_PARAMETERS_DIFFER, SMAD_NO_FIELD, 0, 0, at_us);
        return;
    }
    memset(&command, 0, sizeof command);
    agreed_crc = param_crc;
    crc_agreed = true;
    command.link = link_word();
    command.token = new_token(at_us);
    code = (uint8_t)smad_sv_on_arm_request(&sv, &now.measured, &limits, &command, at_us);
    answer(code, at_us);
    if (code == 0) {
        struct smad_arm_token token;
        uint8_t payload[SMAD_ARM_TOKEN_SIZE];
        token.axis = 0;
        token.token = (uint32_t)command.token;
        token.valid_ms = (uint16_t)(limits.token_us / 1000);
        smad_pack_arm_token(&token, payload);
        session_reply(SMAD_ARM_TOKEN_NUMBER, payload, sizeof payload, at_us);
    }
}

void board_on_arm_confirm(uint32_t token, int64_t at_us)
{
    struct smad_sv_command command;
    uint8_t code;
    memset(&command, 0, sizeof command);
    command.link = link_word();
    command.token = token;
    code = (uint8_t)smad_sv_on_arm_confirm(&sv, &now.measured, &limits, &command, at_us);
    answer(code, at_us);
    if (code == 0) {
        session_done(at_us);
    }
}

void board_on_disarm(int64_t at_us)
{
    smad_sv_on_disarm(&sv, &limits);
    answer(0, at_us);
    session_done(at_us);
}

void board_on_clear_fault(uint8_t fault, int64_t at_us)
{
    struct smad_sv_command command;
    uint8_t code;
    memset(&command, 0, sizeof command);
    command.fault = fault;
    code = (uint8_t)smad_sv_on_clear_fault(&sv, &limits, &command);
    answer(code, at_us);
    if (code == 0) {
        session_done(at_us);
    }
}

void board_on_estop(int64_t at_us)
{
    (void)at_us;
    smad_sv_on_estop(&sv, &limits);
    apply();
    report_fault();
}

/* Parameters */

static void apply_parameters(void)
{
    uint32_t wanted_us = 1000000u / (uint32_t)params_get(PARAM_STATE_RATE_HZ);
    limits = smad_sv_limits_compiled;
    params_tighten(&limits);
    smad_sv_configure(&sv, &limits);
    if (wanted_us != period_us) {
        period_us = wanted_us;
        hal_sample_timer(period_us);
    }
}

/* SAFE, or stopped for damaged parameters: else nothing could ever mend those. */
static bool may_set(void)
{
    return sv.state == SMAD_BOARD_STATE_SAFE
           || (sv.state == SMAD_BOARD_STATE_FAULT && (sv.faults & PARAM_CRC_BIT) != 0);
}

static void refuse_state(int64_t at_us)
{
    uint8_t mode = session_last_mode();
    uint8_t found = mode != SMAD_BOARD_STATE_SAFE ? mode : 0;
    session_refuse(SMAD_ERROR_CODE_WRONG_STATE, SMAD_NO_FIELD, found, SMAD_BOARD_STATE_SAFE, at_us);
}

void board_on_param_get(uint16_t param, int64_t at_us)
{
    struct smad_param_value value;
    uint8_t payload[SMAD_PARAM_VALUE_SIZE];
    if (!params_describe(param, &value)) {
        session_refuse(SMAD_ERROR_CODE_UNKNOWN_PARAMETER, 1, param, 0, at_us);
        return;
    }
    smad_pack_param_value(&value, payload);
    session_reply(SMAD_PARAM_VALUE_NUMBER, payload, sizeof payload, at_us);
}

void board_on_param_set(uint16_t param, int32_t value, int64_t at_us)
{
    int32_t limit = 0;
    uint8_t code;
    if (!may_set()) {
        refuse_state(at_us);
        return;
    }
    code = params_set(param, value, &limit);
    if (code != 0) {
        int32_t found = code == SMAD_ERROR_CODE_UNKNOWN_PARAMETER ? (int32_t)param : value;
        session_refuse(code, 2, found, limit, at_us);
        return;
    }
    board_on_param_get(param, at_us);
    apply_parameters();
}

void board_on_param_save(int64_t at_us)
{
    if (!may_set()) {
        refuse_state(at_us);
        return;
    }
    if (params_saving()) {
        /* Asked for in an earlier session; this one's values are written after it. */
        save_again = true;
        return;
    }
    params_save();
}

static void carry_on_saving(int64_t at_us)
{
    enum params_saving how = params_poll();
    if (save_again && how != SAVING_GOES_ON) {
        save_again = false;
        params_save();
        return;
    }
    switch (how) {
    case SAVING_DONE:
        now.measured.parameters_ok = 1;
        session_done(at_us);
        break;
    case SAVING_FAILED:
        session_refuse(SMAD_ERROR_CODE_SAVE_FAILED, SMAD_NO_FIELD, 0, 0, at_us);
        break;
    default:
        break;
    }
}

/* The loop */

void board_start(void)
{
    last_time_us = hal_time_us();
    now_us = last_time_us;
    now.t_us = now_us;
    stats_due_us = now_us + STATS_EVERY_US;
    now.sp_age_us = SMAD_INVALID_U16;
    smad_sv_init(&sv);
    apply();
    now.measured.parameters_ok = params_load();
    token_state = params_count_boot();
    session_boot(token_state, hal_reset_cause(), now_us);
    apply_parameters();
    restore_latched();
}

void board_poll(void)
{
    uint32_t t_us;
    int byte;
    uint8_t left = BYTES_A_TURN;
    if (hal_sample_due(&t_us)) {
        hal_mark(true);
        take_sample(t_us);
        session_flush(time_now());
        hal_mark(false);
    }
    while (left-- > 0 && (byte = hal_serial_read()) >= 0) {
        /* Only the byte that ends a frame makes anything happen, and needs the time. */
        session_byte((uint8_t)byte, byte == 0 ? time_now() : 0);
        if (byte == 0) {
            break; /* a frame may have taken its time: look for a tick first */
        }
    }
    if (params_saving()) {
        carry_on_saving(time_now());
    }
}
