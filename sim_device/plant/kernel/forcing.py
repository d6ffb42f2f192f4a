"""Forcing of the equations at their places, and laws that make it from the plant's own states.

A place and side has one slot, the order being that of `places.SLOTS`. Laws are a table with a row a
term, see `laws.law_table`. They see the states at the end of the last substep; those at readings
see the sample that is read. What is forced at a reading is given to its sensor, and the states that
laws see have it, too: so a model that is a little off can be led along what was measured.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.model import Constants
from sim_device.plant.kernel.state import FORCED_SLOTS, Sensed, Spring, State, Work

Array = npt.NDArray[np.float64]

# Slots of side X where there are two; that of Y is the next.
HEAT_WIRE, HEAT_WATER, FILM, FLOW_BEFORE, FLOW_BEHIND, SHIFT, STRAIN, CURRENT, RESISTANCE = range(
    0, 18, 2
)
CELL_ON_X, CELL_ON_Y, INLET, AIR = range(18, 22)
FIRST_READING = 22
FIRST_SHARED_READING = 28

# Columns of the table of terms; those of a factor from its first one on.
SLOT, COEFFICIENT, FACTORS, FIRST_FACTOR, FACTOR_COLUMNS = 0, 1, 2, 3, 7
# Columns of the memory of a term: what its lags show, and when it was last evaluated, if ever.
LAGGED, WHEN, BEGUN, MEMORY_COLUMNS = 0, 2, 3, 4
VELOCITY = 7  # number of that state, which is extrapolated to the end of the substep
LINE, BEND, HAT = 1.0, 2.0, 3.0
LEAST_SHARE = 0.01  # what is left of a film or a resistance at least


@inlined
def is_of_y(slot: int) -> bool:
    """Whether a slot belongs to spring Y; what both share is seen from X."""
    if slot >= FIRST_READING:
        return slot < FIRST_SHARED_READING and slot % 2 == 1
    return slot < CELL_ON_X and slot % 2 == 1


@inlined
def reading_at(slot: int, seen: Sensed) -> float:
    """The channel of a slot that is a reading."""
    n = slot - FIRST_READING
    if n < 4:
        if n < 2:
            return float(seen.i_x if n == 0 else seen.i_y)
        return float(seen.v_x if n == 2 else seen.v_y)
    if n < 6:
        return float(seen.rtd_x if n == 4 else seen.rtd_y)
    if n < 8:
        return float(seen.rtd_inlet if n == 6 else seen.rtd_air)
    return float(seen.displacement if n == 8 else seen.force)


@compiled
def state_at(which: int, slot: int, state: State) -> float:
    """A state as the place of a slot sees it, by its number in `places.STATES`."""
    of_y = is_of_y(slot)
    side = state.y if of_y else state.x
    other = state.x if of_y else state.y
    g = state.shared
    sign = -1.0 if of_y else 1.0
    value = 0.0
    if which == 0:
        value = side.T_wire + (g.added.rtd_y if of_y else g.added.rtd_x)
    elif which == 1:
        value = side.T_water
    elif which == 2:
        value = side.current
    elif which == 3:
        value = side.duty
    elif which == 4:
        value = side.memory.xi_S + side.memory.xi_T
    elif which == 5:
        value = side.tension + g.added.force
    elif which == 6:
        value = sign * (g.displacement + g.added.displacement)
    elif which == VELOCITY:
        value = sign * (g.speed + g.added_rate.displacement)
    elif which == 8:
        value = side.T_wire_rate + (g.added_rate.rtd_y if of_y else g.added_rate.rtd_x)
    elif which == 9:
        value = side.fraction_rate
    elif which == 10:
        value = other.T_wire + (g.added.rtd_x if of_y else g.added.rtd_y)
    elif which == 11:
        value = other.duty
    elif which == 12:
        value = g.time
    elif which == 13:
        value = side.cycles
    elif which == 14:
        value = other.current
    elif which == 15:
        value = other.memory.xi_S + other.memory.xi_T
    elif which == 16:
        value = reading_at(slot, g.raw)
    else:
        value = reading_at(slot, g.raw_rate)
    return float(value)


@inlined
def evaluate_factor(
    x: float, kind: float, low: float, high: float, centre: float, scale: float
) -> tuple[float, float]:
    """A factor at a value of its state, and its slope; beyond the support that at its end."""
    slope = 1.0 / scale if low < x < high else 0.0
    z = (min(max(x, low), high) - centre) / scale
    if kind == LINE:
        return z, slope
    if kind == BEND:
        return (z, slope) if z > 0.0 else (0.0, 0.0)
    if kind == HAT:
        left = 1.0 - abs(z)
        if left <= 0.0:
            return 0.0, 0.0
        return left, (-slope if z > 0.0 else slope)
    bent = math.tanh(z)
    return bent, slope * (1.0 - bent * bent)


@compiled
def evaluate_term(
    i: int, slot: int, laws: Array, memory: Array, state: State
) -> tuple[float, float]:
    """One term of a law, its coefficient included, and its slope with the velocity."""
    value = 1.0
    by_velocity = 0.0
    now = state.shared.time
    for n in range(int(laws[i, FACTORS])):
        column = FIRST_FACTOR + FACTOR_COLUMNS * n
        which = int(laws[i, column])
        x = state_at(which, slot, state)
        lag = laws[i, column + 1]
        if lag > 0.0:
            if memory[i, BEGUN] > 0.0:
                before = memory[i, LAGGED + n]
                x = before + (x - before) * (1.0 - math.exp(-(now - memory[i, WHEN]) / lag))
            memory[i, LAGGED + n] = x
        f, slope = evaluate_factor(
            x,
            laws[i, column + 2],
            laws[i, column + 3],
            laws[i, column + 4],
            laws[i, column + 5],
            laws[i, column + 6],
        )
        if which != VELOCITY or lag > 0.0:
            slope = 0.0
        by_velocity = by_velocity * f + value * slope
        value *= f
    memory[i, WHEN] = now
    memory[i, BEGUN] = 1.0
    return laws[i, COEFFICIENT] * value, laws[i, COEFFICIENT] * by_velocity


@inlined
def force_spring(s: Spring, side: int, work: Work, p: Constants) -> None:
    """What is forced at one spring, to where its equations take it."""
    w = work.x if side == 0 else work.y
    now = work.forced
    w.forced_heat = now[HEAT_WIRE + side] * p.per_length
    w.forced_water = now[HEAT_WATER + side] * p.per_length
    w.forced_film = max(1.0 + now[FILM + side], LEAST_SHARE)
    w.forced_shift = now[SHIFT + side]
    s.forced_deflection = now[STRAIN + side]


@compiled
def force_places(state: State, work: Work, p: Constants, laws: Array, memory: Array) -> None:
    """All that is forced in this substep: what is held over the sample, and what laws make.

    What depends on the velocity is made to follow it within the substep, where that resists the
    motion: a law may rub or drag.
    """
    now = work.forced
    for j in range(FIRST_READING):
        now[j] = work.held[j]
    on_x = on_y = 0.0
    for i in range(laws.shape[0]):
        slot = int(laws[i, SLOT])
        if slot < FIRST_READING:
            value, by_velocity = evaluate_term(i, slot, laws, memory, state)
            now[slot] += value
            if slot == CELL_ON_X:
                on_x += by_velocity
            elif slot == CELL_ON_Y:
                on_y += by_velocity
    g = state.shared
    force_spring(state.x, 0, work, p)
    force_spring(state.y, 1, work, p)
    g.forced_inlet = now[INLET]
    g.forced_air = now[AIR]
    if on_x + on_y <= 0.0:
        on_x = on_y = 0.0
    work.between_slope = on_x + on_y
    work.between = now[CELL_ON_X] + now[CELL_ON_Y] - (on_x + on_y) * g.speed
    work.cell_slope = 0.5 * (on_x - on_y)
    work.cell = 0.5 * (now[CELL_ON_X] - now[CELL_ON_Y]) - work.cell_slope * g.speed


@inlined
def forced_duty(duty: float, slot: int, work: Work) -> float:
    """The duty that a pump is given, with what is forced before it."""
    return float(max(duty + work.forced[slot], 0.0))


@inlined
def force_flow(s: Spring, slot: int, work: Work, p: Constants) -> None:
    """Add what is forced behind a pump."""
    s.pump_flow = max(s.pump_flow + work.forced[slot] * p.flow_max, 0.0)


@inlined
def force_current(s: Spring, current: float, slot: int, work: Work) -> float:
    """The current of a spring, never below zero; what was forced is remembered."""
    forced = max(current + work.forced[slot], 0.0)
    s.forced_current = forced - current
    return float(forced)


@inlined
def force_resistance(s: Spring, slot: int, work: Work) -> None:
    """Change the resistance of a spring, just made anew, by the share that is forced."""
    s.resistance = s.resistance * max(1.0 + work.forced[slot], LEAST_SHARE)


@compiled
def keep_raw(seen: Sensed, raw: Sensed) -> None:
    """What the sensors give before anything is forced."""
    raw.i_x = seen.i_x
    raw.i_y = seen.i_y
    raw.v_x = seen.v_x
    raw.v_y = seen.v_y
    raw.rtd_x = seen.rtd_x
    raw.rtd_y = seen.rtd_y
    raw.rtd_inlet = seen.rtd_inlet
    raw.rtd_air = seen.rtd_air
    raw.displacement = seen.displacement
    raw.force = seen.force


@compiled
def set_rates(seen: Sensed, raw: Sensed, rate: Sensed, dt: float) -> None:
    """Rates of what the sensors give, over the last sample; none before the first."""
    per_dt = 1.0 / dt if dt > 0.0 else 0.0
    rate.i_x = (seen.i_x - raw.i_x) * per_dt
    rate.i_y = (seen.i_y - raw.i_y) * per_dt
    rate.v_x = (seen.v_x - raw.v_x) * per_dt
    rate.v_y = (seen.v_y - raw.v_y) * per_dt
    rate.rtd_x = (seen.rtd_x - raw.rtd_x) * per_dt
    rate.rtd_y = (seen.rtd_y - raw.rtd_y) * per_dt
    rate.rtd_inlet = (seen.rtd_inlet - raw.rtd_inlet) * per_dt
    rate.rtd_air = (seen.rtd_air - raw.rtd_air) * per_dt
    rate.displacement = (seen.displacement - raw.displacement) * per_dt
    rate.force = (seen.force - raw.force) * per_dt


@compiled
def force_readings(state: State, work: Work, laws: Array, memory: Array, dt: float) -> None:
    """Add to the readings of a sample that lasted dt what is forced there."""
    g = state.shared
    seen = g.sensed
    set_rates(seen, g.raw, g.raw_rate, dt)
    keep_raw(seen, g.raw)
    now = work.forced
    for j in range(FIRST_READING, FORCED_SLOTS):
        now[j] = 0.0
    for i in range(laws.shape[0]):
        slot = int(laws[i, SLOT])
        if slot >= FIRST_READING:
            now[slot] += evaluate_term(i, slot, laws, memory, state)[0]
    seen.i_x += now[FIRST_READING]
    seen.i_y += now[FIRST_READING + 1]
    seen.v_x += now[FIRST_READING + 2]
    seen.v_y += now[FIRST_READING + 3]
    seen.rtd_x += now[FIRST_READING + 4]
    seen.rtd_y += now[FIRST_READING + 5]
    seen.rtd_inlet += now[FIRST_READING + 6]
    seen.rtd_air += now[FIRST_READING + 7]
    seen.displacement += now[FIRST_READING + 8]
    seen.force += now[FIRST_READING + 9]
