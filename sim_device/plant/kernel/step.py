"""One substep of the plant, one sample, and the state it starts from."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.accept import accept_motion, accept_substep
from sim_device.plant.kernel.compiled import compiled, entry, inlined
from sim_device.plant.kernel.equilibrium import solve_pair, solve_resisted_pair, solve_tension
from sim_device.plant.kernel.forcing import (
    CURRENT,
    FLOW_BEFORE,
    FLOW_BEHIND,
    RESISTANCE,
    force_current,
    force_flow,
    force_places,
    force_readings,
    force_resistance,
    forced_duty,
)
from sim_device.plant.kernel.heat import prepare_spring
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.mechanics import (
    REST_SPEED,
    deflect_frozen,
    friction_at,
    resistance_to_motion,
    slack_position,
    tension_at,
)
from sim_device.plant.kernel.model import ANTAGONISTIC, STRETCH, Model
from sim_device.plant.kernel.sensors import read_sensors
from sim_device.plant.kernel.state import SpringFeed, SpringWork, State, Work
from sim_device.plant.kernel.supply import apply_current, drive_current, run_pump, supply_water
from sim_device.plant.kernel.temperatures import set_tension, solve_spring

Array = npt.NDArray[np.float64]

OK = 0
NOT_CONVERGED = 1
NOT_FINITE = 2


@compiled
def move_pair(u: float, state: State, work: Work, model: Model, dt: float) -> int:
    """Antagonistic pair: equilibrium, or both springs at a fed displacement u."""
    x, y, g, wx, wy, p = state.x, state.y, state.shared, work.x, work.y, model.p
    if work.feeds.feeds_displacement > 0.0:
        F_x = solve_tension(p.delta_0 - u, x.tension, x, wx, p, model.x)
        F_y = solve_tension(p.delta_0 + u, y.tension, y, wy, p, model.y)
    elif model.x.resists > 0.0 or work.between != 0.0 or work.between_slope > 0.0:
        guess = x.tension + dt * g.tension_rate
        F_x, F_y, u = solve_resisted_pair(guess, state, work, model, dt)
    else:
        F_x = solve_pair(g.tension + dt * g.tension_rate, state, work, model)
        F_y = F_x
        u = slack_position(u, wx, wy, p) if F_x == 0.0 else p.delta_0 - wx.deflection
    if F_x < 0.0 or F_y < 0.0:
        return NOT_CONVERGED
    accept_substep(F_x, x, wx, g, p, model.x, dt)
    accept_substep(F_y, y, wy, g, p, model.y, dt)
    accept_motion(g, u, 0.5 * (F_x + F_y), dt)
    g.forced_cell = work.cell + work.cell_slope * g.speed
    return OK


@inlined
def held_deflection(stage: float, model: Model) -> float:
    """Deflection of spring X held by the stage (stretch) or between walls (blocked), m."""
    return stage if model.p.fixture == STRETCH else model.p.delta_0 + stage


@compiled
def move_single(state: State, work: Work, model: Model, dt: float) -> int:
    """Spring X held by the stage or between walls; Y hangs free."""
    x, y, g, p, e = state.x, state.y, state.shared, model.p, model.x
    stage = work.drive.stage
    guess = g.tension + dt * g.tension_rate
    F_x = solve_tension(held_deflection(stage, model), guess, x, work.x, p, e)
    set_tension(0.0, work.y, p, model.y)
    if F_x < 0.0 or not solve_spring(y, work.y, p, model.y):
        return NOT_CONVERGED
    F = F_x
    if e.resists > 0.0:
        speed = (stage - g.displacement) / dt
        F += 0.5 * e.drag * x.filled * speed + e.tube_stiffness * stage
        if abs(speed) > REST_SPEED:
            F += 0.5 * math.copysign(friction_at(F_x, speed, e), speed)
    if work.forces > 0.0:
        F += 0.5 * work.between
        g.forced_cell = work.cell
    if e.resists > 0.0 or work.forces > 0.0:
        F = max(F, 0.0)
    accept_substep(F_x, x, work.x, g, p, e, dt)
    accept_substep(0.0, y, work.y, g, p, model.y, dt)
    accept_motion(g, stage, F, dt)
    return OK


@compiled
def move_fed(F: float, u: float, state: State, work: Work, model: Model, dt: float) -> int:
    """Kinetics under a fed tension; tension or displacement then follow from Eq. (9)."""
    x, y, g, wx, wy = state.x, state.y, state.shared, work.x, work.y
    p, e, e_y = model.p, model.x, model.y
    pair = p.fixture == ANTAGONISTIC
    push = resistance_to_motion(F, u, g, e, dt) if e.resists > 0.0 else 0.0
    if work.forces > 0.0:
        push += work.between
        g.forced_cell = work.cell
    tension = F + 0.5 * push if F + 0.5 * push > 0.0 else 0.0
    other = F - 0.5 * push if pair and F - 0.5 * push > 0.0 else 0.0
    set_tension(tension, wx, p, e)
    set_tension(other, wy, p, e_y)
    if not (solve_spring(x, wx, p, e) and solve_spring(y, wy, p, e_y)):
        return NOT_CONVERGED
    F_y = 0.0
    if not pair:
        u = work.drive.stage
        F_x = tension_at(held_deflection(u, model), x, wx, p, e)
        deflect_frozen(0.0, y, wy, p, e_y)
        result = F_x
    elif work.feeds.feeds_displacement > 0.0:
        F_x = tension_at(p.delta_0 - u, x, wx, p, e)
        F_y = tension_at(p.delta_0 + u, y, wy, p, e_y)
        result = 0.5 * (F_x + F_y)
    else:
        deflect_frozen(0.0, x, wx, p, e)
        deflect_frozen(0.0, y, wy, p, e_y)
        gap = 2.0 * p.delta_0 - wx.deflection - wy.deflection
        F_x = (gap + push * wy.compliance) / (wx.compliance + wy.compliance)
        F_x = F_x if gap > 0.0 and F_x > 0.0 else 0.0
        F_y = F_x - push if F_x > push else 0.0
        deflect_frozen(F_x, x, wx, p, e)
        deflect_frozen(F_y, y, wy, p, e_y)
        u = slack_position(u, wx, wy, p) if F_x == 0.0 else p.delta_0 - wx.deflection
        result = 0.5 * (F_x + F_y)
    accept_substep(F_x, x, wx, g, p, e, dt)
    accept_substep(F_y, y, wy, g, p, e_y, dt)
    accept_motion(g, u, result, dt)
    return OK


@inlined
def take_feed(w: SpringWork, fed: SpringFeed, flag: float, share: float) -> None:
    """The fed temperature of one spring at the end of the substep, into scratch."""
    w.fed = flag
    w.T_fed = fed.T_start + share * (fed.T_end - fed.T_start)


@inlined
def set_surroundings(state: State, work: Work, model: Model, dt: float) -> None:
    """Inlet and air in this substep: as given, with what effects add, or as fed."""
    g = state.shared
    g.air_rise += (model.x.air_drift + model.x.air_bend * (2.0 * g.time + dt)) * dt
    g.T_inlet = g.given_inlet + g.reservoir_rise + g.forced_inlet
    g.T_air = g.given_air + g.air_rise + g.forced_air
    if work.feeds.feeds_surroundings > 0.0:
        g.T_inlet = work.feeds.T_inlet
        g.T_air = work.feeds.T_air


@inlined
def supply_springs(state: State, work: Work, model: Model, dt: float) -> None:
    """Water and current that both springs get in this substep."""
    x, y, p, drive, feeds = state.x, state.y, model.p, work.drive, work.feeds
    forces = work.forces > 0.0
    x.duty = drive.duty_x
    y.duty = drive.duty_y
    if forces:
        run_pump(x, p, model.x, forced_duty(x.duty, FLOW_BEFORE, work), 1.0, dt)
        run_pump(y, p, model.y, forced_duty(y.duty, FLOW_BEFORE + 1, work), -1.0, dt)
        force_flow(x, FLOW_BEHIND, work, p)
        force_flow(y, FLOW_BEHIND + 1, work, p)
        # A lagging driver follows what it makes itself.
        x.current -= x.forced_current
        y.current -= y.forced_current
    else:
        run_pump(x, p, model.x, x.duty, 1.0, dt)
        run_pump(y, p, model.y, y.duty, -1.0, dt)
    supply_water(x, y, p, model.x, drive.drain_x, dt)
    supply_water(y, x, p, model.y, drive.drain_y, dt)
    if feeds.feeds_current > 0.0:
        apply_current(x, p, model.x, feeds.x.current, feeds.x.current, 0.0)
        apply_current(y, p, model.y, feeds.y.current, feeds.y.current, 0.0)
    else:
        i_x, mean_x, variance_x = drive_current(x, p, model.x, drive.i_x, dt)
        i_y, mean_y, variance_y = drive_current(y, p, model.y, drive.i_y, dt)
        if forces:
            i_x = force_current(x, i_x, CURRENT, work)
            i_y = force_current(y, i_y, CURRENT + 1, work)
            mean_x += x.forced_current
            mean_y += y.forced_current
        apply_current(x, p, model.x, i_x, mean_x, variance_x)
        apply_current(y, p, model.y, i_y, mean_y, variance_y)
    if forces:
        force_resistance(x, RESISTANCE, work)
        force_resistance(y, RESISTANCE + 1, work)


@compiled
def advance_substep(
    state: State, work: Work, model: Model, table: Array, share: float, dt: float
) -> int:
    """One substep of both springs; `share` is how far into the sample its end is.

    The fractions depend on temperature and stress at the end of the substep, the temperature on the
    fractions (latent heat), and the stress on both, so a lagged value would either oscillate or
    ratchet; the three are solved at once.
    """
    x, y, g, feeds = state.x, state.y, state.shared, work.feeds
    forces = work.forces > 0.0
    set_surroundings(state, work, model, dt)
    supply_springs(state, work, model, dt)
    take_feed(work.x, feeds.x, feeds.feeds_temperature, share)
    take_feed(work.y, feeds.y, feeds.feeds_temperature, share)
    prepare_spring(x, y, work.x, g, model.p, model.x, table, forces, dt)
    prepare_spring(y, x, work.y, g, model.p, model.y, table, forces, dt)
    g.time += dt
    u = g.displacement
    if feeds.feeds_displacement > 0.0:
        u = feeds.displacement_start
        u += share * (feeds.displacement_end - feeds.displacement_start)
    if feeds.feeds_force > 0.0:
        F = feeds.force_start + share * (feeds.force_end - feeds.force_start)
        F = F if F > 0.0 else 0.0
        return move_fed(F, u, state, work, model, dt)
    if model.p.fixture == ANTAGONISTIC:
        return move_pair(u, state, work, model, dt)
    return move_single(state, work, model, dt)


@entry
def advance(
    states: OneRecord,
    works: OneRecord,
    models: OneRecord,
    ring: Array,
    table: Array,
    laws: Array,
    memory: Array,
    dt: float,
    steps: int,
) -> int:
    """Advance the state by one sample of `steps` substeps of `dt`. Returns a status.

    Takes arrays of one record each; what the board applies is `works[0].drive`. laws (m, 17):
    terms, see `laws.law_table`; memory (m, 4): what they remember. They act where
    `works[0].forces` is 1.
    """
    state, work, model = states[0], works[0], models[0]
    for k in range(steps):
        # What is held over the sample needs it but once.
        if work.forces > 0.0 and (k == 0 or laws.shape[0] > 0):
            force_places(state, work, model.p, laws, memory)
        status = advance_substep(state, work, model, table, (k + 1.0) / steps, dt)
        if status != OK:
            return status
    read_sensors(state, model, ring, dt * steps)
    if work.forces > 0.0:
        force_readings(state, work, laws, memory, dt * steps)
    x, y, g = state.x, state.y, state.shared
    seen = g.sensed.rtd_x + g.sensed.rtd_y + g.tension + g.displacement
    if not math.isfinite(x.T_wire + y.T_wire + x.T_water + y.T_water + seen):
        return NOT_FINITE
    return OK


@inlined
def wake_sensors(state: State, model: Model, ring: Array) -> None:
    """The sensors' first sample, before anything has been advanced."""
    g = state.shared
    g.T_inlet = g.given_inlet
    g.T_air = g.given_air
    read_sensors(state, model, ring, 0.0)
