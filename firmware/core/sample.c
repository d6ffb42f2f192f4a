#include "sample.h"

#include "convert.h"
#include "hal.h"

#include <string.h>

#define RTDS 4u

static uint16_t valid_bits(const struct sample *s)
{
    uint16_t valid = SMAD_VALID_BIT_I_X | SMAD_VALID_BIT_I_Y | SMAD_VALID_BIT_V_X
                     | SMAD_VALID_BIT_V_Y | SMAD_VALID_BIT_VBUS;
    for (uint8_t j = 0; j < RTDS; j++) {
        if (s->measured.rtd_cC[j] > SMAD_SV_LIMIT_RAIL_LOW_CC && s->measured.rtd_cC[j] < SMAD_SV_LIMIT_RAIL_HIGH_CC) {
            valid = (uint16_t)(valid | SMAD_VALID_BIT_RTD_X << j);
        }
    }
    if (!s->measured.encoder_invalid) {
        valid |= SMAD_VALID_BIT_ENCODER;
    }
    if (!s->measured.force_invalid) {
        valid |= SMAD_VALID_BIT_FORCE;
    }
    if (s->sp_age_us != SMAD_INVALID_U16) {
        valid |= SMAD_VALID_BIT_SETPOINT;
    }
    return valid;
}

void sample_tell(const struct sample *s, const struct smad_sv_memory *sv,
                 struct smad_state *state)
{
    memset(state, 0, sizeof *state);
    state->t_us = (uint32_t)s->t_us;
    state->tick = s->tick;
    state->mode = (uint8_t)sv->state;
    state->limiter = (uint8_t)(sv->limiter[0] > sv->limiter[1] ? sv->limiter[0] : sv->limiter[1]);
    state->faults = (uint32_t)sv->faults;
    state->warnings = (uint16_t)sv->warnings;
    for (uint8_t k = 0; k < 2; k++) {
        state->i_meas_mA[k] = (int16_t)s->measured.i_mA[k];
        state->i_applied_mA[k] = (int16_t)sv->applied_mA[k];
        state->v_mV[k] = (uint16_t)s->measured.v_mV[k];
        state->pump_duty[k] = (uint8_t)sv->duty[k];
    }
    for (uint8_t j = 0; j < RTDS; j++) {
        state->rtd_cC[j] = (int16_t)s->measured.rtd_cC[j];
    }
    state->encoder_counts = s->measured.encoder_invalid ? SMAD_INVALID_I32 : s->encoder_counts;
    state->force_counts = s->force_counts;
    state->vbus_mV = (uint16_t)s->measured.vbus_mV;
    state->valid = valid_bits(s);
    state->sp_seq = s->sp_seq;
    state->sp_age_us = s->sp_age_us;
}

void sample_read(struct sample *s, const struct smad_sv_memory *sv)
{
    uint8_t inputs = hal_inputs();
    uint16_t codes[HAL_ANALOGS];
    for (uint8_t j = 0; j < HAL_ANALOGS; j++) {
        codes[j] = hal_analog((enum hal_analog)j);
        if (j < RTDS) {
            s->measured.rtd_cC[j] = convert_rtd(hal_rtd(j));
        }
    }
    for (uint8_t k = 0; k < 2; k++) {
        s->measured.applied_mA[k] = sv->applied_mA[k];
        s->measured.duty[k] = sv->duty[k];
        s->measured.i_mA[k] = (int16_t)convert_analog(codes[HAL_I_X + k], CONVERT_CURRENT_MA);
        s->measured.v_mV[k] = convert_analog(codes[HAL_V_X + k], CONVERT_SPRING_MV);
        s->measured.pump_rpm[k] = convert_tacho(hal_tacho_us(k));
    }
    s->measured.vbus_mV = convert_analog(codes[HAL_VBUS], CONVERT_SUPPLY_MV);
    s->encoder_counts = hal_encoder();
    s->force_counts = hal_bridge();
    s->measured.leak = (inputs & HAL_INPUT_LEAK) != 0;
    s->measured.encoder_invalid = (inputs & HAL_INPUT_ENCODER_ALARM) != 0;
    s->measured.force_invalid = !convert_bridge_valid(s->force_counts);
}
