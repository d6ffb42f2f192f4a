"""The machine: what a sample and what each command of the host does.

This module is translated to C (see translate): integers, no allocation, no exceptions.
A command returns an ErrorCode, 0 for accepted; a refusal leaves the measured value, the limit and
the channel in `s.value`, `s.limit` and `s.channel`.
"""

from __future__ import annotations

from firmware_protocol.enums import BoardState, Channel, ErrorCode, Fault, Limiter, Warning
from firmware_protocol.supervisor.checks import BAD, GOOD
from firmware_protocol.supervisor.flat import (
    CURRENT_ALLOWED,
    FAULT_PUMPS,
    GATE,
    PUMP_POLICY,
    TRANSITION,
    TRIGGER_COUNT,
)
from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import Command, Measurements, Memory
from firmware_protocol.supervisor.observers import (
    DUTY_FULL,
    FCC_PER_CC,
    forget_jumps,
    is_believed,
    observe_jumps,
    observe_spring,
    observe_surroundings,
    reset_spring,
    set_pace,
)
from firmware_protocol.supervisor.states import PumpPolicy, Trigger
from firmware_protocol.supervisor.table import (
    ACTIVE_LINES,
    CHECK_CHANNEL,
    CHECK_FAULT,
    CHECK_FUNCTION,
)

DT_MOST_US = 10_000_000
I32_MOST = 0x7FFF_FFFF
I32_LEAST = -0x8000_0000

LINK_SESSION = 1
LINK_SCHEMA = 2
LINK_PARAMETERS = 4
LINK_CLOCK = 8


def fire(s: Memory, trigger: int) -> bool:
    """Follow the trigger's arrow from the present state; return whether there is one."""
    following = TRANSITION[s.state * TRIGGER_COUNT + trigger]
    if following < 0:
        return False
    s.state = following
    s.entered_us = s.now_us
    s.cooling = 1
    return True


def saturated(value: int) -> int:
    """Return the value as far as the wire can hold it: ERROR and FAULT_REPORT carry 32 bits."""
    return min(max(value, I32_LEAST), I32_MOST)


def remember(s: Memory, fault: int, channel: int) -> None:
    """Add a fault; remember it with s.value and s.limit if it is the first one."""
    s.faults |= 1 << (fault - 1)
    if not s.latched:
        s.latched = 1
        s.first_fault = fault
        s.first_channel = channel
        s.first_value = saturated(s.value)
        s.first_limit = saturated(s.limit)
        s.first_us = s.now_us


def latch(s: Memory, fault: int, channel: int, trigger: int) -> None:
    """Add a fault, and follow its trigger. One that forbids the pumps also stops running ones."""
    remember(s, fault, channel)
    fire(s, trigger)
    s.cooling &= FAULT_PUMPS[fault]


def run_checks(s: Memory, m: Measurements, lim: Limits) -> None:
    """Run every check that is active in the present state, with its debounce."""
    state = s.state
    for line in ACTIVE_LINES[state]:
        verdict = CHECK_FUNCTION[line](s, m, lim, CHECK_CHANNEL[line])
        if verdict == GOOD:
            s.bad_samples[line] = 0
        elif verdict == BAD:
            if s.bad_samples[line] == 0:
                s.bad_us[line] = 0
            else:
                s.bad_us[line] += s.dt_us
            s.bad_samples[line] += 1
            if s.bad_samples[line] >= s.need_samples[line] and s.bad_us[line] >= s.need_us[line]:
                latch(s, CHECK_FAULT[line], CHECK_CHANNEL[line], Trigger.FAULT_RAISED)


def run_timers(s: Memory, lim: Limits) -> None:
    """Let time move the machine: setpoints expire, HOLD ends, COOL and the pumps of FAULT end."""
    cold = s.sensor_ok[0] and s.sensor_ok[1] and max(s.t_cC[0], s.t_cC[1]) < lim.cold_cC
    capped = s.now_us - s.entered_us >= lim.cool_cap_us
    if s.state == BoardState.ARMED:
        if s.now_us - s.setpoint_us > s.setpoint_ttl_us:
            fire(s, Trigger.SETPOINT_EXPIRED)
    elif s.state == BoardState.HOLD:
        if s.now_us - s.entered_us > lim.hold_us:
            s.value = s.now_us - s.setpoint_us
            s.limit = s.setpoint_ttl_us + lim.hold_us
            latch(s, Fault.SETPOINT_LOST, Channel.BOARD, Trigger.HOLD_EXPIRED)
    elif s.state == BoardState.COOL:
        if cold or capped:
            s.capped = not cold
            fire(s, Trigger.COOLED)
    elif s.state == BoardState.FAULT and (cold or capped):
        # Where gate and driver both stay conducting, nothing but water cools.
        flows = max(s.i_uA[0], s.i_uA[1]) > lim.off_current_mA * 1000
        s.cooling = s.cooling and flows


def set_warnings(s: Memory, m: Measurements, lim: Limits) -> None:
    """Set the bits that are worth a look."""
    warnings = 0
    if s.stale_setpoints and s.now_us - s.stale_at_us < 1_000_000:
        warnings |= 1 << Warning.SETPOINT_STALE
    if s.jumps[0] + s.jumps[1] + s.jumps[2] + s.jumps[3]:
        warnings |= 1 << Warning.RTD_JUMP
    if max(s.t_cC[0], s.t_cC[1]) > lim.fold_start_cC:
        warnings |= 1 << Warning.NEAR_TEMPERATURE_LIMIT
    if max(s.i2t_mA2us[0], s.i2t_mA2us[1]) >= s.i2t_near_mA2us:
        warnings |= 1 << Warning.NEAR_I2T_LIMIT
    if m.vbus_mV < lim.brown_out_mV + 1000:
        warnings |= 1 << Warning.SUPPLY_LOW
    if 2 * s.dt_us > lim.overrun_us:
        warnings |= 1 << Warning.LOOP_LATE
    if s.capped and s.state == BoardState.SAFE:
        warnings |= 1 << Warning.COOL_CAP
    if not (s.sensor_ok[0] and s.sensor_ok[1]):
        warnings |= 1 << Warning.SENSOR_INVALID
    s.warnings = warnings


def find_ceiling(s: Memory, lim: Limits, k: int) -> None:
    """Set the ceiling of spring k: the maximum, lowered by I2t and by temperature."""
    ceiling_mA = lim.current_limit_mA
    limiter = int(Limiter.MAXIMUM)
    if s.i2t_mA2us[k] >= s.i2t_budget_mA2us and ceiling_mA > lim.i2t_rated_mA:
        ceiling_mA = lim.i2t_rated_mA
        limiter = Limiter.I2T
    # The heaviest good spring is never warmer than the true one: it stands in for a slow sensor.
    t_cC = max(s.t_cC[k], s.low_fcC[k] // FCC_PER_CC)
    # An end that was tightened below the start cuts the current there.
    if t_cC > min(lim.fold_start_cC, lim.fold_end_cC):
        span_cC = max(lim.fold_end_cC - lim.fold_start_cC, 1)
        left_cC = max(lim.fold_end_cC - t_cC, 0)
        folded_mA = lim.current_limit_mA * left_cC // span_cC
        if folded_mA < ceiling_mA:
            ceiling_mA = folded_mA
            limiter = Limiter.TEMPERATURE
    if not CURRENT_ALLOWED[s.state]:
        ceiling_mA = 0
        limiter = Limiter.GATE
    s.ceiling_mA[k] = ceiling_mA
    s.ceiling_limiter[k] = limiter


def regulate(s: Memory, k: int) -> None:
    """Set what the driver and the pump of spring k get, from setpoint, ceiling and slew."""
    wanted_mA = s.setpoint_mA[k]
    limiter = int(Limiter.NONE)
    if wanted_mA > s.ceiling_mA[k]:
        wanted_mA = s.ceiling_mA[k]
        limiter = s.ceiling_limiter[k]
    if wanted_mA > s.slew_from_mA[k] + s.slew_step_mA:
        wanted_mA = s.slew_from_mA[k] + s.slew_step_mA
        if limiter == Limiter.NONE:
            limiter = Limiter.SLEW
    s.applied_mA[k] = wanted_mA
    s.limiter[k] = limiter
    policy = PUMP_POLICY[s.state]
    if policy == PumpPolicy.SETPOINT:
        s.duty[k] = s.setpoint_duty[k]
    elif policy == PumpPolicy.COOL:
        s.duty[k] = DUTY_FULL
    elif policy == PumpPolicy.BY_FAULT:
        s.duty[k] = DUTY_FULL * (s.cooling & FAULT_PUMPS[s.first_fault])
    else:
        s.duty[k] = 0


def decide(s: Memory, lim: Limits) -> None:
    """Set all outputs from the present state."""
    s.gate = GATE[s.state]
    for k in range(2):
        find_ceiling(s, lim, k)
        regulate(s, k)


def sample(s: Memory, m: Measurements, lim: Limits, now_us: int) -> None:
    """Take one sample: observe, check, move the machine, decide."""
    if s.started:
        s.dt_us = min(max(now_us - s.now_us, 0), DT_MOST_US)
    s.now_us = now_us
    set_pace(s, lim)
    observe_surroundings(s, m, lim)
    if not s.started:
        forget_jumps(s, m)
    observe_jumps(s, m, lim)
    for k in range(2):
        observe_spring(s, m, lim, k)
        if not s.started:
            reset_spring(s, k)
        s.slew_from_mA[k] = s.applied_mA[k]
    s.started = 1
    run_timers(s, lim)
    run_checks(s, m, lim)
    set_warnings(s, m, lim)
    decide(s, lim)


def on_restart(s: Memory, c: Command) -> int:
    """Remember in BOOT the first fault from before a reset, with s.channel, s.value and s.limit."""
    remember(s, min(max(c.fault, Fault.SELF_TEST), Fault.OVER_CURRENT), s.channel)
    return 0


def on_self_test(s: Memory, lim: Limits, c: Command) -> int:
    """End BOOT, in FAULT if there was one before the reset."""
    if c.passed and s.latched:
        fire(s, Trigger.FAULT_RAISED)
    elif c.passed:
        fire(s, Trigger.SELF_TEST_PASSED)
    else:
        s.value = 0
        s.limit = 0
        latch(s, Fault.SELF_TEST, Channel.BOARD, Trigger.FAULT_RAISED)
    decide(s, lim)
    return 0


def refuse(s: Memory, code: int, channel: int, value: int, limit: int) -> int:
    """Leave what a refusal must name, and return its code."""
    s.channel = channel
    s.value = saturated(value)
    s.limit = saturated(limit)
    return code


def arming_obstacle(s: Memory, m: Measurements, lim: Limits, link: int) -> int:
    """Return why the board cannot be armed now, 0 if it can."""
    if s.state == BoardState.FAULT:
        return refuse(s, ErrorCode.FAULT_PRESENT, s.first_channel, s.first_fault, 0)
    if s.state != BoardState.SAFE:
        return refuse(s, ErrorCode.WRONG_STATE, Channel.BOARD, s.state, BoardState.SAFE)
    if not link & LINK_SESSION:
        return refuse(s, ErrorCode.NO_SESSION, Channel.BOARD, 0, 0)
    if not link & LINK_SCHEMA:
        return refuse(s, ErrorCode.SCHEMA_DIFFERS, Channel.BOARD, 0, 0)
    if not link & LINK_PARAMETERS:
        return refuse(s, ErrorCode.PARAMETERS_DIFFER, Channel.BOARD, 0, 0)
    if not link & LINK_CLOCK:
        return refuse(s, ErrorCode.CLOCK_UNLOCKED, Channel.BOARD, 0, 0)
    for j in range(4):
        if not is_believed(m, lim, j):
            return refuse(s, ErrorCode.SENSOR_INVALID, j, m.rtd_cC[j], lim.rail_high_cC)
    if m.encoder_invalid:
        return refuse(s, ErrorCode.SENSOR_INVALID, Channel.ENCODER, m.encoder_invalid, 0)
    if m.force_invalid:
        return refuse(s, ErrorCode.SENSOR_INVALID, Channel.FORCE, m.force_invalid, 0)
    for k in range(2):
        if m.rtd_cC[k] >= lim.cold_cC:
            return refuse(s, ErrorCode.TOO_HOT, k, m.rtd_cC[k], lim.cold_cC)
        # Noise is not in the filtered current, and a current that just ended is not in the raw one.
        i_mA = min(m.i_mA[k], s.i_uA[k] // 1000)
        if i_mA > lim.off_current_mA:
            return refuse(s, ErrorCode.CURRENT_FLOWING, k, i_mA, lim.off_current_mA)
    if m.vbus_mV < lim.brown_out_mV:
        return refuse(s, ErrorCode.SUPPLY_LOW, Channel.BOARD, m.vbus_mV, lim.brown_out_mV)
    return 0


def on_arm_request(s: Memory, m: Measurements, lim: Limits, c: Command, now_us: int) -> int:
    """First step of arming: keep the token if nothing is in the way."""
    s.token_valid = 0
    code = arming_obstacle(s, m, lim, c.link)
    if code == 0:
        s.token = c.token
        s.token_us = now_us
        s.token_valid = 1
    return code


def on_arm_confirm(s: Memory, m: Measurements, lim: Limits, c: Command, now_us: int) -> int:
    """Second step of arming: a token works once, whatever comes of it."""
    usable = s.token_valid
    s.token_valid = 0
    code = arming_obstacle(s, m, lim, c.link)
    if code:
        return code
    if not usable or c.token != s.token:
        return refuse(s, ErrorCode.TOKEN_WRONG, Channel.BOARD, c.token, 0)
    if now_us - s.token_us > lim.token_us:
        return refuse(s, ErrorCode.TOKEN_EXPIRED, Channel.BOARD, now_us - s.token_us, lim.token_us)
    fire(s, Trigger.ARM_CONFIRMED)
    begin_run(s, m, lim, now_us)
    decide(s, lim)
    return 0


def begin_run(s: Memory, m: Measurements, lim: Limits, now_us: int) -> None:
    """Start all observers and timers of one arming, at a setpoint of zero."""
    s.armed_at_us = now_us
    s.setpoint_us = now_us
    s.setpoint_ttl_us = lim.setpoint_ttl_ms * 1000
    s.capped = 0
    forget_jumps(s, m)
    for k in range(2):
        s.setpoint_mA[k] = 0
        s.setpoint_duty[k] = 0
        reset_spring(s, k)
    forget_bad(s)


def forget_bad(s: Memory) -> None:
    """Start the debounce of every check afresh."""
    for line in range(s.lines):
        s.bad_samples[line] = 0


def on_setpoint(s: Memory, lim: Limits, c: Command, now_us: int) -> int:
    """Take a setpoint unless it is stale or moves the stage too far; it counts at once."""
    if c.age_us < 0 or c.age_us > lim.setpoint_age_us:
        s.stale_setpoints += 1
        s.stale_at_us = now_us
        return refuse(s, ErrorCode.SETPOINT_STALE, Channel.BOARD, c.age_us, lim.setpoint_age_us)
    if not GATE[s.state]:
        return refuse(s, ErrorCode.WRONG_STATE, Channel.BOARD, s.state, BoardState.ARMED)
    if c.stage_um < 0:
        return refuse(s, ErrorCode.OUT_OF_RANGE, Channel.BOARD, c.stage_um, 0)
    if c.stage_um > lim.stage_travel_um:
        return refuse(s, ErrorCode.OUT_OF_RANGE, Channel.BOARD, c.stage_um, lim.stage_travel_um)
    for k in range(2):
        s.setpoint_mA[k] = c.i_mA[k]
        s.setpoint_duty[k] = c.duty[k]
    s.setpoint_us = now_us
    s.setpoint_ttl_us = min(c.ttl_us, lim.setpoint_ttl_ms * 1000)
    fire(s, Trigger.SETPOINT_FRESH)
    decide(s, lim)
    return 0


def on_disarm(s: Memory, lim: Limits) -> int:
    """End heating. Where nothing heats there is nothing to do, and that is no error."""
    s.token_valid = 0
    fire(s, Trigger.DISARM)
    decide(s, lim)
    return 0


def on_estop(s: Memory, lim: Limits) -> int:
    """Switch everything off until the power is cycled."""
    s.token_valid = 0
    if s.state != BoardState.ESTOP:
        s.value = 0
        s.limit = 0
        latch(s, Fault.ESTOP_PRESSED, Channel.BOARD, Trigger.ESTOP)
    decide(s, lim)
    return 0


def on_clear_fault(s: Memory, lim: Limits, c: Command) -> int:
    """Leave FAULT if the first fault is the one named, its cause is gone, and all is cold."""
    if s.state != BoardState.FAULT:
        return refuse(s, ErrorCode.WRONG_STATE, Channel.BOARD, s.state, BoardState.FAULT)
    if c.fault != s.first_fault:
        return refuse(s, ErrorCode.WRONG_FAULT, s.first_channel, c.fault, s.first_fault)
    for line in ACTIVE_LINES[s.state]:
        if s.bad_samples[line] > 0:
            return refuse(s, ErrorCode.CAUSE_REMAINS, CHECK_CHANNEL[line], CHECK_FAULT[line], 0)
    for k in range(2):
        if s.t_cC[k] >= lim.cold_cC:
            return refuse(s, ErrorCode.TOO_HOT, k, s.t_cC[k], lim.cold_cC)
    s.faults = 0
    s.latched = 0
    forget_bad(s)
    fire(s, Trigger.FAULT_CLEARED)
    decide(s, lim)
    return 0
