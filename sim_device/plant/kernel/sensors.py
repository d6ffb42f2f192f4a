"""What the sensors make of the state, without noise."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.front import wire_off_at
from sim_device.plant.kernel.model import ANTAGONISTIC, Constants, Effects, Model
from sim_device.plant.kernel.state import (
    RING_F,
    RING_ROWS,
    RING_T_X,
    RING_T_Y,
    RING_TIME,
    RING_U,
    Shared,
    Spring,
    State,
)

Ring = npt.NDArray[np.float64]


@inlined
def recall(ring: Ring, samples: float, column: int, when: float) -> float:
    """A channel of the history at a time, linear between samples; the oldest one before them."""
    newest = int(samples) - 1
    oldest = newest - RING_ROWS + 1
    oldest = max(oldest, 0)
    n = newest
    while n > oldest and ring[n % RING_ROWS, RING_TIME] > when:
        n -= 1
    here = n % RING_ROWS
    if n == newest or ring[here, RING_TIME] >= when:
        return float(ring[here, column])
    then = (n + 1) % RING_ROWS
    part = (when - ring[here, RING_TIME]) / (ring[then, RING_TIME] - ring[here, RING_TIME])
    return float(ring[here, column] + part * (ring[then, column] - ring[here, column]))


@inlined
def read_late(g: Shared, e: Effects, ring: Ring) -> None:
    """Effects channel_delay and clock_skew: read temperature, displacement and force late."""
    seen = g.sensed
    n = int(g.samples)
    now = g.time
    row = n % RING_ROWS
    ring[row, RING_TIME] = now
    ring[row, RING_T_X] = seen.rtd_x
    ring[row, RING_T_Y] = seen.rtd_y
    ring[row, RING_U] = seen.displacement
    ring[row, RING_F] = seen.force
    when = now - e.skew_ppm * 1e-6 * now
    seen.rtd_x = recall(ring, n + 1, RING_T_X, when - e.delay_T)
    seen.rtd_y = recall(ring, n + 1, RING_T_Y, when - e.delay_T)
    seen.displacement = recall(ring, n + 1, RING_U, when - e.delay_u)
    seen.force = recall(ring, n + 1, RING_F, when - e.delay_F)


@inlined
def read_rtd(s: Spring, added: float, T_air: float, e: Effects, dt: float) -> float:
    """Temperature of one spring as its RTD gives it, K."""
    T = s.T_wire + added
    if e.front > 0.0:
        T += e.front * wire_off_at(e.rtd_place, s)
    if e.rtd_stem != 0.0:
        T -= e.rtd_stem * (T - T_air)
    T += e.rtd_offset
    if e.rtd_lag > 0.0:
        given = T
        if dt > 0.0:
            # Of what changes evenly over the sample.
            remaining = math.exp(-dt / e.rtd_lag)
            behind = (T - s.rtd_given) * e.rtd_lag / dt * (1.0 - remaining)
            T = T - behind + (s.rtd_lagged - s.rtd_given) * remaining
        s.rtd_given = given
        s.rtd_lagged = T
    return T


@inlined
def read_encoder(g: Shared, e: Effects) -> float:
    """Displacement as the encoder gives it, m."""
    u = g.displacement + g.added.displacement
    if e.slip_share != 0.0:
        if u > g.slip_from:
            g.slip -= e.slip_share * (u - g.slip_from)
        g.slip_from = u
        u += g.slip
    if e.backlash > 0.0:
        half = 0.5 * e.backlash
        if g.play < u - half:
            g.play = u - half
        elif g.play > u + half:
            g.play = u + half
        u = g.play
    return u


@inlined
def read_force(state: State, p: Constants, e: Effects, dt: float) -> float:
    """Tension as the force sensor gives it, N: of the tendon, the mean of what pulls on both."""
    g = state.shared
    F = g.tension + g.forced_cell + g.added.force
    if e.reads_x != 0.0 and p.fixture == ANTAGONISTIC:
        F += e.reads_x * (state.x.tension - state.y.tension)
    if e.creep_share != 0.0:
        if dt > 0.0:
            g.creep = F + (g.creep - F) * math.exp(-dt / e.creep_time)
        else:
            g.creep = F
        F += e.creep_share * (g.creep - p.F0)
    if e.force_gain != 0.0:
        F = F * (1.0 + e.force_gain)
    return F + e.force_offset


@compiled
def read_sensors(state: State, model: Model, ring: Ring, dt: float) -> None:
    """What the sensors give at the end of a sample that lasted dt; dt = 0 before the first."""
    x, y, g, seen = state.x, state.y, state.shared, state.shared.sensed
    added = g.added
    seen.i_x = x.current + added.i_x + model.x.current_offset
    seen.i_y = y.current + added.i_y + model.y.current_offset
    seen.v_x = x.current * (x.resistance + model.x.contact_resistance) + added.v_x
    seen.v_y = y.current * (y.resistance + model.y.contact_resistance) + added.v_y
    seen.rtd_x = read_rtd(x, added.rtd_x, g.T_air, model.x, dt)
    seen.rtd_y = read_rtd(y, added.rtd_y, g.T_air, model.y, dt)
    # Not what is fed: these are what the plant itself would show.
    seen.rtd_inlet = g.given_inlet + g.reservoir_rise + g.forced_inlet + added.rtd_inlet
    seen.rtd_air = g.given_air + model.x.air_seen * g.air_rise + g.forced_air + added.rtd_air
    seen.displacement = read_encoder(g, model.x)
    seen.force = read_force(state, model.p, model.x, dt)
    if model.x.late > 0.0:
        read_late(g, model.x, ring)
    g.samples += 1.0
