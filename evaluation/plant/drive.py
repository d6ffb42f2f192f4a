"""What reaches the wire and the tube: real current and real water flow, with their effects."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMPERE,
    CELLS,
    CHIP,
    DAMP,
    FLOW,
    GLANCE,
    HOT,
    JUNCTION,
    KEPT,
    KICK,
    KINKED,
    LAG_A,
    LAG_B,
    LAG_C,
    LIMITED,
    LOOSE,
    OHM,
    PUMP,
    PUMP_ON,
    REFILLING,
    RETURN,
    RING_DUTY_X,
    RING_LENGTH,
    ROLLER,
    RUN_DOWN,
    SILT,
    SPEED,
    SPIN,
    SPIN_RATE,
    STARTED,
    STRAYED,
    TIME,
    WOUND,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import falling

Array = NDArray[np.float64]

RESISTANCE = index("resistance_ohm")
DRIVER_LAG = index("driver_lag_s")
PUMP_LAG = index("pump_lag_s")
FULL_FLOW = index("flow_W_K")
Y_FLOW = index("y_flow")

DRIVER_GAIN = slot("driver_gain")
SLOW_DRIVER = slot("driver_lag")
SATURATION = slot("saturation")
SMALL_SIGNAL = slot("driver_small_signal")
BEAT = slot("supply_beat")
DEAD_TIME = slot("pump_dead_time")
SHORTFALL = slot("flow_shortfall")
LEAK = slot("valve_leak")
CAVITATION = slot("pump_cavitation")
THERMOSIPHON = slot("thermosiphon")
REVERSE = slot("reverse_flow")
FOLDBACK = slot("driver_foldback")
DROOP = slot("pump_load_droop")
STICTION = slot("pump_stiction")
VISCOSITY = slot("warm_viscosity")
WETTING = slot("tendon_wetting")
STRAY = slot("tendon_stray_current")
CLOGGING = slot("strainer_clogging")
WINDUP = slot("idle_windup")
KICKS = slot("rail_kick")
PULSES = slot("roller_pulses")
REFRESH = slot("gate_refresh")
LEAKAGE = slot("bridge_leakage")
KINK = slot("tube_kink")
BREATHING = slot("breathing_tube")
POWER_LIMIT = slot("shared_power_limit")
COARSE = slot("coarse_driver")

CURRENT_LIMIT_A = 4.0
IDLE_A = 0.05  # command below which the current loop counts as idle
SELF_FILLING_A = 0.8  # current up to which the bridge switches enough to keep its gates supplied
REFILL_S = 0.25
OPENS_mm = 2.0  # way back from where a tube has folded until it is open again


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
def drawn(side: Array) -> float:
    """What both pumps draw from the supply, one pump at full speed being 1; more at its start."""
    load = 0.0
    for s in range(2):
        load += side[s, PUMP] + 1.5 * max(0.0, side[s, PUMP] - side[s, STARTED])
    return load


@compiled
def wound_up(s: int, command: float, side: Array, dt: float) -> float:
    """How far the current loop is still wound up (0…1) from its last idling."""
    if command > IDLE_A:
        left = side[s, WOUND]
        side[s, WOUND] = approach(left, 0.0, dt, 0.6)
        return float(left)
    side[s, WOUND] = approach(side[s, WOUND], 1.0, dt, 5.0)
    return 0.0


@compiled
def kicked(s: int, side: Array, dt: float) -> float:
    """What flies back (A) from the other side's current, where that has fallen of late."""
    fell = max(side[s, KEPT] - side[s, LAG_C], 0.0)
    side[s, KEPT] = side[s, LAG_C]
    side[s, KICK] = approach(side[s, KICK], 0.0, dt, 0.3) + fell
    return float(side[1 - s, KICK])


@compiled
def refilling(s: int, i: float, side: Array, dt: float) -> float:
    """Share of this tick in which the bridge pauses to refill the supply of its gates."""
    if i > SELF_FILLING_A:
        side[s, RUN_DOWN] += dt / 1.5 * (i - SELF_FILLING_A) / (CURRENT_LIMIT_A - SELF_FILLING_A)
    else:
        side[s, RUN_DOWN] = approach(side[s, RUN_DOWN], 0.0, dt, 1.0)
    if side[s, RUN_DOWN] >= 1.0:
        side[s, RUN_DOWN] = 0.0
        side[s, REFILLING] = REFILL_S
    spent = min(side[s, REFILLING], dt)
    side[s, REFILLING] -= spent
    return float(spent / dt)


@compiled
def leaking(s: int, side: Array, dt: float) -> float:
    """What the bridge leaks, as a multiple of its leakage: it doubles with each step of heat."""
    relative = side[s, LAG_C] / CURRENT_LIMIT_A
    side[s, CHIP] = approach(side[s, CHIP], relative * relative, dt, 14.0)
    return float(2.0 ** (4.0 * side[s, CHIP]) - 1.0)


@compiled
def current(
    s: int, command: float, p: Array, e: Array, side: Array, time: float, dt: float
) -> float:
    """Real current (A) through spring `s` for a commanded one."""
    i = min(max(command, 0.0), CURRENT_LIMIT_A)
    if e[s, WINDUP] > 0.0:
        i *= 1.0 + e[s, WINDUP] * wound_up(s, i, side, dt)
    eaten = e[s, SMALL_SIGNAL]
    if eaten > 0.0:
        i = math.sqrt(i * i + eaten * eaten) - eaten
    if e[s, DRIVER_GAIN] != 0.0:
        i *= 1.0 + e[s, DRIVER_GAIN] * (1.0 - 0.08 * i)
    if e[s, BEAT] > 0.0:
        hertz = 0.17 + 0.23 * e[2, BEAT]
        i *= 1.0 + e[s, BEAT] * math.sin(2.0 * math.pi * hertz * time + 0.6 * s)
    if e[s, SATURATION] > 0.0:
        knee = CURRENT_LIMIT_A / e[s, SATURATION] * p[RESISTANCE] / side[s, OHM]
        i /= (1.0 + (i / knee) ** 8) ** 0.125
    if e[s, FOLDBACK] > 0.0:
        side[s, JUNCTION] = approach(side[s, JUNCTION], i * i / 16.0, dt, 9.0)
        i /= 1.0 + e[s, FOLDBACK] * max(0.0, side[s, JUNCTION] - 0.12)
    if e[s, DROOP] > 0.0:
        i *= 1.0 - min(0.8, e[s, DROOP] * drawn(side) * 0.25 * i)
    if e[0, POWER_LIMIT] > 0.0:
        watts = side[0, AMPERE] ** 2 * side[0, OHM] + side[1, AMPERE] ** 2 * side[1, OHM]
        side[s, LIMITED] = approach(side[s, LIMITED], max(watts / 8.0 - 1.0, 0.0), dt, 0.5)
        i /= 1.0 + e[0, POWER_LIMIT] * side[s, LIMITED]
    if e[s, COARSE] > 0.0:
        i = e[s, COARSE] * round(i / e[s, COARSE])
    if e[s, REFRESH] > 0.0:
        i *= 1.0 - e[s, REFRESH] * refilling(s, i, side, dt)
    if e[s, LEAKAGE] > 0.0:
        off = max(0.0, 1.0 - i / CURRENT_LIMIT_A)
        i += e[s, LEAKAGE] * leaking(s, side, dt) * off
    side[s, LAG_A] = approach(side[s, LAG_A], i, dt, p[DRIVER_LAG])
    slow = e[s, SLOW_DRIVER]
    if slow <= 0.0:
        side[s, LAG_B] = side[s, LAG_A]
        side[s, LAG_C] = side[s, LAG_A]
    else:
        side[s, LAG_B] = approach(side[s, LAG_B], side[s, LAG_A], dt, 0.5 * slow)
        side[s, LAG_C] = approach(side[s, LAG_C], side[s, LAG_B], dt, 0.5 * slow)
    if e[s, KICKS] > 0.0:
        return float(side[s, LAG_C] + e[s, KICKS] * kicked(s, side, dt))
    return float(side[s, LAG_C])


@compiled
def stray(e: Array, side: Array) -> None:
    """Set what each source's current loses (A) through the tendon to the other wire."""
    if e[0, STRAY] > 0.0:
        across = side[0, AMPERE] * side[0, OHM] - side[1, AMPERE] * side[1, OHM]
        side[0, STRAYED] = e[0, STRAY] * across
        side[1, STRAYED] = -side[0, STRAYED]


@compiled
def throttled(s: int, share: float, strength: float, side: Array, dt: float) -> float:
    """Share of the flow that passes the strainer, which gathers silt with what it passes."""
    passed = share / (1.0 + strength * side[s, SILT])
    if passed > 0.02:
        side[s, SILT] += dt * passed / 15.0
    else:
        side[s, SILT] = approach(side[s, SILT], 0.0, dt, 30.0)
    return float(passed)


@compiled
def _pump_speed(
    s: int, p: Array, e: Array, side: Array, pair: Array, ring: Array, dt: float
) -> float:
    dead = e[s, DEAD_TIME]
    duty = late(ring, RING_DUTY_X + s, pair[GLANCE], dead / dt)
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
def spun(s: int, share: float, needed: float, side: Array, dt: float) -> float:
    """Share of its speed that a pump reaches which starts at `needed` and stops at a quarter."""
    turning = share >= (0.25 * needed if side[s, LOOSE] > 0.5 else needed)
    if turning:
        side[s, LOOSE] = approach(max(side[s, LOOSE], 0.51), 1.0, dt, 0.4 * needed)
    else:
        side[s, LOOSE] = 0.0
    return float(side[s, LOOSE])


@compiled
def kinked(s: int, shape: float, side: Array, pair: Array) -> float:
    """How far the tube of a spring is folded (0…1); once folded it opens later."""
    past_mm = 1e3 * (pair[X] if s == 0 else -pair[X]) - 3.0 - 1.5 * shape
    folds = 1.0 - falling(past_mm / 1.2)
    stays = 1.0 - falling((past_mm + OPENS_mm) / 1.2)
    side[s, KINKED] = min(max(side[s, KINKED], folds), stays)
    return float(side[s, KINKED])


@compiled
def flow(
    s: int,
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    inlet: float,
    heat_W: float,
    dt: float,
) -> float:
    """Heat capacity rate (W/K) of the water through tube `s`; negative when it runs back."""
    share = _pump_speed(s, p, e, side, pair, ring, dt)
    if e[s, SHORTFALL] > 0.0 and share > 0.0:
        share = (1.0 - e[s, SHORTFALL]) * share ** (1.0 + e[s, SHORTFALL])
    side[s, STARTED] = approach(side[s, STARTED], side[s, PUMP], dt, 1.2)
    if e[s, STICTION] > 0.0:
        share *= spun(s, share, e[s, STICTION], side, dt)
    if e[s, CLOGGING] > 0.0:
        share = throttled(s, share, e[s, CLOGGING], side, dt)
    if e[s, PULSES] > 0.0:
        hertz = 0.15 + 0.2 * e[2, PULSES]
        side[s, ROLLER] += dt * hertz * share
        share *= 1.0 + e[s, PULSES] * math.sin(2.0 * math.pi * side[s, ROLLER])
    if e[s, KINK] > 0.0:
        share *= 1.0 - e[s, KINK] * kinked(s, e[2, KINK], side, pair)
    running = share > 0.05
    side[s, PUMP_ON] = side[s, PUMP_ON] + dt if running else 0.0
    if e[s, CAVITATION] > 0.0:
        side[s, HOT] += dt * (heat_W / 25.0 - side[s, HOT] / 30.0)
        gas = min(1.0, side[s, HOT]) * math.exp(-side[s, PUMP_ON] / 3.0)
        share *= 1.0 - e[s, CAVITATION] * gas
    warm = 0.0
    for i in range(CELLS):
        warm += cells[s, i, W] / CELLS
    if e[s, VISCOSITY] > 0.0:
        share *= math.exp(e[s, VISCOSITY] * (warm - 27.0) / (20.0 + abs(warm - 27.0)))
    if e[s, THERMOSIPHON] > 0.0:
        share += e[s, THERMOSIPHON] * max(0.0, warm - inlet) / 20.0 * max(0.0, 1.0 - 5.0 * share)
    if e[s, BREATHING] > 0.0:
        share += e[s, BREATHING] * min(abs(pair[SPEED]) / 5e-3, 3.0)
    if e[s, REVERSE] > 0.0:
        if running:
            side[s, RETURN] = approach(side[s, RETURN], share, dt, 0.8)
        else:
            side[s, RETURN] = approach(side[s, RETURN], 0.0, dt, 2.5)
            share -= e[s, REVERSE] * side[s, RETURN]
    full = p[FULL_FLOW] * (p[Y_FLOW] if s == 1 else 1.0)
    return float(full * share)


@compiled
def flows(
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    inlet: float,
    heat_x: float,
    heat_y: float,
    dt: float,
) -> None:
    """Set `side[:, FLOW]` of both tubes, with what leaks from one into the other."""
    x = flow(0, p, e, cells, side, pair, ring, inlet, heat_x, dt)
    y = flow(1, p, e, cells, side, pair, ring, inlet, heat_y, dt)
    full = p[FULL_FLOW]
    side[0, FLOW] = x + e[1, LEAK] * max(y, 0.0) ** 2 / full
    side[1, FLOW] = y + e[0, LEAK] * max(x, 0.0) ** 2 / full
    if e[0, WETTING] > 0.0:
        wets = max(side[0, FLOW], 0.0) + max(side[1, FLOW], 0.0)
        rate = wets / full / 6.0
        pair[DAMP] += dt * (rate * (1.0 - pair[DAMP]) - pair[DAMP] / 40.0)
    pair[TIME] += dt
