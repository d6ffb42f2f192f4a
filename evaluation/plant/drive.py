"""What reaches the wire and the tube: real current and real water flow, with their effects."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AIR_DRAWN,
    AMPERE,
    CLOGGED,
    DUTY_BEFORE,
    FLAP,
    FLOW,
    FUSE_WARM,
    GLANCE,
    HEAD_AIR,
    HELD_DOWN,
    INRUSH,
    KICK,
    LAG_A,
    LAG_B,
    LAG_C,
    LONG_ON,
    OHM,
    OTHER_PLUME,
    PRIMED,
    PUMP,
    RAMPED,
    RETURN_POT,
    RING_DUTY_X,
    RING_LENGTH,
    ROLLED,
    SET_BEFORE,
    SPEED,
    SPILT,
    SPIN,
    SPIN_RATE,
    STAGE,
    TAP_OPEN,
    THROTTLE,
    TIME,
    TIRED,
    TONE,
    VORTEX,
    WOUND,
)
from evaluation.plant.parameters import index

Array = NDArray[np.float64]

RESISTANCE = index("resistance_ohm")
DRIVER_LAG = index("driver_lag_s")
PUMP_LAG = index("pump_lag_s")
FULL_FLOW = index("flow_W_K")
Y_FLOW = index("y_flow")

DRIVER_GAIN = slot("driver_gain")
SLOW_DRIVER = slot("driver_lag")
SATURATION = slot("saturation")
DEAD_TIME = slot("pump_dead_time")
SHORTFALL = slot("flow_shortfall")
LEAK = slot("valve_leak")
CHATTER = slot("chattering_plug")
PEAK_AND_HOLD = slot("peak_and_hold")
SUCTION = slot("shared_suction")
MEMBRANE = slot("tired_membrane")
HEAD = slot("air_in_pump_head")
POT = slot("filling_return_pot")
VARIAC = slot("play_in_variac")
CALIBRATES = slot("calibrating_driver")
UNPRIMED = slot("unprimed_hose")
SHAKES = slot("shaking_pump")
INRUSH_LIMIT = slot("inrush_limiter")
REFERENCE = slot("settling_reference")
THROTTLE_PLAY = slot("play_in_throttle")
KICKS = slot("kick_started_pump")
BURSTS = slot("burst_firing")
WORN_TRACK = slot("worn_setpoint_track")
LIFTS_PUMP = slot("pump_on_heater_ground")
SUCKS_AIR = slot("vortex_over_intake")
JOINS = slot("joining_stage")
TAPS = slot("changing_taps")
RAMPS = slot("ramped_pump")
CLEANS = slot("self_cleaning_filter")
TONES = slot("idle_tone_of_modulator")
THERMISTOR = slot("thermistor_on_wrong_tube")
ROLLERS = slot("pulsing_rollers")
STICKS = slot("sticking_flap")

CURRENT_LIMIT_A = 4.0
PEAK_A, PEAK_S = 0.8, 2.5  # a solenoid driver holds back what was on for longer
CALIBRATES_S = 9.0  # how often a driver calibrates itself, for 1 s
SHAKES_AT, SHAKES_OVER = 0.55, 0.15  # speed at which a pump shakes, and how far from it
GATHERS_AT, BLOWN_OUT_AT = 0.05, 0.85  # speed of a pump whose head gathers air, or loses it
BURST_S = 3.0  # how often a driver fires a burst
TRACK_A = 0.4  # how much of a set value's track is worn
JOINS_A, LEAVES_A = 2.2, 1.4  # set value at which a second stage joins in and leaves
TAP_S = 0.5  # how long a changer of taps is open
CLEANS_S = 4.0  # of full flow, after which a filter flushes itself back
TONE_A_S = 8.0  # what a driver gives in one turn of its modulator's tone
ROLLERS_S = 8.0  # of full speed, in which a pump's rollers turn once
VORTEX_AT, VORTEX_S = 0.6, 3.0  # both flows' share above which a vortex grows, and how fast


@compiled
def late(ring: Array, row: int, tick: float, ticks_late: float) -> float:
    """Value of a ring buffer's row `ticks_late` ago, between the stored ticks."""
    behind = min(max(ticks_late, 0.0), tick, RING_LENGTH - 2.0)
    whole = int(behind)
    part = behind - whole
    newer = (int(tick) - whole) % RING_LENGTH
    older = (int(tick) - min(whole + 1, int(tick))) % RING_LENGTH
    return float((1.0 - part) * ring[row, newer] + part * ring[row, older])


@compiled
def approach(state: float, target: float, dt: float, time_constant: float) -> float:
    """One pole, exact for an input that holds over the step."""
    return target + (state - target) * math.exp(-dt / max(time_constant, 1e-9))


@compiled
def switched(
    state: float, seen: float, on: float, off: float, dt: float, time_constant: float
) -> float:
    """A switch with hysteresis: towards 1 above `on`, towards 0 below `off`, else as it stands."""
    if seen > on:
        return approach(state, 1.0, dt, time_constant)
    if seen < off:
        return approach(state, 0.0, dt, time_constant)
    return state


@compiled
def current(
    s: int, command: float, p: Array, e: Array, side: Array, pair: Array, dt: float
) -> float:
    """Real current (A) through spring `s` for a commanded one."""
    i = min(max(command, 0.0), CURRENT_LIMIT_A)
    side[s, STAGE] = switched(side[s, STAGE], i, JOINS_A, LEAVES_A, dt, 0.3)
    tap = 1.0 + 2.0 * e[2, TAPS]
    if (i - tap) * (side[s, SET_BEFORE] - tap) < 0.0:
        side[s, TAP_OPEN] = TAP_S
    side[s, SET_BEFORE] = i
    i *= 1.0 + e[s, JOINS] * side[s, STAGE]
    if side[s, TAP_OPEN] > 0.0:
        i *= 1.0 - min(e[s, TAPS], 0.9)
        side[s, TAP_OPEN] -= dt
    side[s, TONE] += dt * i / TONE_A_S
    i *= 1.0 + min(e[s, TONES], 0.9) * math.sin(2.0 * math.pi * (side[s, TONE] + e[2, TONES]))
    i *= max(0.1, 1.0 - e[1 - s, THERMISTOR] * side[s, OTHER_PLUME])
    half = 0.5 * e[s, VARIAC]
    side[s, WOUND] = min(max(side[s, WOUND], i - half), i + half)
    if i > 0.0:
        i = max(side[s, WOUND], 0.0)
    off = (i - 1.0 - 2.0 * e[2, WORN_TRACK]) / TRACK_A
    i *= 1.0 - min(e[s, WORN_TRACK], 0.9) * math.exp(-off * off)
    turn = pair[TIME] / BURST_S + e[2, BURSTS]
    burst = CURRENT_LIMIT_A if turn - math.floor(turn) < i / CURRENT_LIMIT_A else 0.0
    i += min(e[s, BURSTS], 1.0) * (burst - i)
    turn = pair[TIME] / CALIBRATES_S + e[2, CALIBRATES]
    if turn - math.floor(turn) < 1.0 / CALIBRATES_S:
        i *= 1.0 - min(e[s, CALIBRATES], 0.9)
    side[s, INRUSH] = approach(side[s, INRUSH], (side[s, AMPERE] / 4.0) ** 2, dt, 3.0)
    i *= 1.0 - min(e[s, INRUSH_LIMIT], 0.9) / (1.0 + 8.0 * side[s, INRUSH])
    i *= 1.0 + e[s, REFERENCE] * math.exp(-pair[TIME] / 12.0)
    if e[s, DRIVER_GAIN] != 0.0:
        i *= 1.0 + e[s, DRIVER_GAIN] * (1.0 - 0.08 * i)
    if e[s, SATURATION] > 0.0:
        knee = CURRENT_LIMIT_A / e[s, SATURATION] * p[RESISTANCE] / side[s, OHM]
        i /= (1.0 + (i / knee) ** 8) ** 0.125
    if e[s, CHATTER] > 0.0:
        speed = abs(pair[SPEED])
        i *= 1.0 - min(e[s, CHATTER], 0.9) * speed / (speed + 2e-3)
    if e[s, PEAK_AND_HOLD] > 0.0:
        side[s, LONG_ON] = side[s, LONG_ON] + dt if i > PEAK_A else 0.0
        target = 1.0 if side[s, LONG_ON] > PEAK_S else 0.0
        side[s, HELD_DOWN] = approach(side[s, HELD_DOWN], target, dt, 0.4)
        i *= 1.0 - min(e[s, PEAK_AND_HOLD], 0.9) * side[s, HELD_DOWN]
    side[s, FUSE_WARM] = approach(side[s, FUSE_WARM], (side[s, AMPERE] / 4.0) ** 2, dt, 6.0)
    side[s, LAG_A] = approach(side[s, LAG_A], i, dt, p[DRIVER_LAG])
    slow = e[s, SLOW_DRIVER]
    if slow <= 0.0:
        side[s, LAG_B] = side[s, LAG_A]
        side[s, LAG_C] = side[s, LAG_A]
    else:
        side[s, LAG_B] = approach(side[s, LAG_B], side[s, LAG_A], dt, 0.5 * slow)
        side[s, LAG_C] = approach(side[s, LAG_C], side[s, LAG_B], dt, 0.5 * slow)
    return float(side[s, LAG_C])


@compiled
def _pump_speed(
    s: int, p: Array, e: Array, side: Array, pair: Array, ring: Array, dt: float
) -> float:
    dead = e[s, DEAD_TIME]
    duty = late(ring, RING_DUTY_X + s, pair[GLANCE], dead / dt)
    side[s, KICK] = approach(side[s, KICK], 0.0, dt, 1.5) + max(duty - side[s, DUTY_BEFORE], 0.0)
    side[s, DUTY_BEFORE] = duty
    side[s, PUMP] = approach(side[s, PUMP], duty, dt, p[PUMP_LAG])
    if dead <= 0.0:
        side[s, SPIN] = side[s, PUMP]
        return float(side[s, PUMP])
    rate = 4.0 / dead
    side[s, SPIN_RATE] = (
        side[s, SPIN_RATE] + dt * rate * rate * (side[s, PUMP] - side[s, SPIN])
    ) / (1.0 + 1.2 * rate * dt + (rate * dt) ** 2)
    side[s, SPIN] += dt * side[s, SPIN_RATE]
    return float(max(side[s, SPIN], 0.0))


@compiled
def flow(s: int, p: Array, e: Array, side: Array, pair: Array, ring: Array, dt: float) -> float:
    """Heat capacity rate (W/K) of the water through tube `s`."""
    share = _pump_speed(s, p, e, side, pair, ring, dt)
    share += e[s, LIFTS_PUMP] * side[s, AMPERE] / 4.0
    share += e[s, KICKS] * side[s, KICK]
    half = 0.5 * e[s, THROTTLE_PLAY]
    side[s, THROTTLE] = min(max(side[s, THROTTLE], share - half), share + half)
    share = side[s, THROTTLE]
    side[s, RAMPED] = min(share, side[s, RAMPED] + dt / max(e[s, RAMPS], 1e-9))
    share = side[s, RAMPED]
    share *= 1.0 - min(e[s, CLEANS], 0.95) * side[s, CLOGGED]
    side[s, CLOGGED] += dt / CLEANS_S * share
    side[s, CLOGGED] -= math.floor(side[s, CLOGGED])
    side[s, ROLLED] += dt * side[s, PUMP] / ROLLERS_S
    rolling = math.sin(2.0 * math.pi * (side[s, ROLLED] + e[2, ROLLERS]))
    share *= 1.0 + min(e[s, ROLLERS], 0.95) * rolling
    if side[s, PUMP] < 0.05:
        side[s, FLAP] = approach(side[s, FLAP], 1.0, dt, 5.0)
    side[s, FLAP] *= math.exp(-dt / 2.0 * side[s, PUMP])
    share *= 1.0 - min(e[s, STICKS], 0.95) * side[s, FLAP]
    off = (side[s, PUMP] - SHAKES_AT) / SHAKES_OVER
    share *= 1.0 - min(e[s, SHAKES], 0.95) * math.exp(-off * off)
    share *= 1.0 - min(e[s, UNPRIMED], 0.95) * math.exp(-side[s, PRIMED])
    side[s, PRIMED] += dt / 8.0 * share
    if side[s, PUMP] > BLOWN_OUT_AT:
        side[s, HEAD_AIR] = approach(side[s, HEAD_AIR], 0.0, dt, 0.5)
    elif side[s, PUMP] > GATHERS_AT:
        side[s, HEAD_AIR] = approach(side[s, HEAD_AIR], 1.0, dt, 5.0)
    share *= 1.0 - min(e[s, HEAD], 0.95) * side[s, HEAD_AIR]
    if e[s, SHORTFALL] > 0.0 and share > 0.0:
        share = (1.0 - e[s, SHORTFALL]) * share ** (1.0 + e[s, SHORTFALL])
    if e[s, MEMBRANE] > 0.0:
        slow = 10.0 if share > side[s, TIRED] else 25.0
        side[s, TIRED] = approach(side[s, TIRED], share, dt, slow)
        share *= 1.0 - min(e[s, MEMBRANE], 0.95) * min(side[s, TIRED], 1.0)
    full = p[FULL_FLOW] * (p[Y_FLOW] if s == 1 else 1.0)
    return float(full * share)


@compiled
def flows(p: Array, e: Array, side: Array, pair: Array, ring: Array, dt: float) -> None:
    """Set `side[:, FLOW]` of both tubes, with what leaks from one into the other."""
    x = flow(0, p, e, side, pair, ring, dt)
    y = flow(1, p, e, side, pair, ring, dt)
    full = p[FULL_FLOW]
    if e[0, SUCTION] > 0.0:
        side[0, AIR_DRAWN] = max(x / full, approach(side[0, AIR_DRAWN], 0.0, dt, 6.0))
        side[1, AIR_DRAWN] = max(y / full, approach(side[1, AIR_DRAWN], 0.0, dt, 6.0))
        x *= 1.0 - min(e[0, SUCTION] * side[1, AIR_DRAWN], 0.95)
        y *= 1.0 - min(e[0, SUCTION] * side[0, AIR_DRAWN], 0.95)
    pair[RETURN_POT] += dt / 6.0 * ((x + y) / full - math.sqrt(pair[RETURN_POT]))
    pair[RETURN_POT] = max(pair[RETURN_POT], 0.0)
    headless = max(1.0 - e[0, POT] * pair[RETURN_POT], 0.05)
    x *= headless
    y *= headless
    drawn = max((x + y) / full - VORTEX_AT, 0.0)
    pair[VORTEX] = approach(pair[VORTEX], drawn, dt, VORTEX_S)
    airless = max(1.0 - e[0, SUCKS_AIR] * pair[VORTEX], 0.05)
    x *= airless
    y *= airless
    side[0, FLOW] = x + e[1, LEAK] * y**2 / full
    side[1, FLOW] = y + e[0, LEAK] * x**2 / full
    spilt = (side[0, FLOW] + side[1, FLOW]) / full
    pair[SPILT] = approach(pair[SPILT], spilt, dt, 3.0 if spilt > pair[SPILT] else 20.0)
    pair[TIME] += dt
