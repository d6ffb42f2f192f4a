"""The state a plant starts from: at rest, mounted as the fixture says."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry, inlined
from sim_device.plant.kernel.curves import clip01
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.mechanics import compliance
from sim_device.plant.kernel.model import PROGRESS_HIGH, Constants, Effects
from sim_device.plant.kernel.paper_kinetics import progress_a, progress_b, progress_c
from sim_device.plant.kernel.state import CELLS, TURNS, Memory, Spring
from sim_device.plant.kernel.step import wake_sensors
from sim_device.plant.kernel.unified_kinetics import (
    cooling_progress,
    heating_progress,
    transformation_starts,
)


class Mounting:
    """How a plant is put together, and what surrounds it."""

    T_x: float  # of wire, water and tube of X, K
    T_y: float
    T_inlet: float
    T_air: float
    tension: float  # of a spring that is loaded, N
    xi_S: float  # its detwinned fraction, Eq. (10)
    deflection: float  # m
    displacement: float  # at which the pair starts, m
    loads_x: float  # 1 when the spring is mounted under load
    loads_y: float


@inlined
def rest_memory(m: Memory, xi_S: float, T: float, tau: float, p: Constants, e: Effects) -> None:
    """Kinetics of a spring or a cell that is all martensite, at a temperature and a stress."""
    m.xi_S = xi_S
    m.xi_T = 1.0 - xi_S
    m.stress_progress = progress_b(T, tau, p)
    if e.unified > 0.0:
        hot, cold = transformation_starts(tau, p)
        m.heating.progress = heating_progress(T, hot, p)
        m.cooling.progress = cooling_progress(T, cold, p)
        m.direction = 1.0
        m.xi_turn = 1.0
        for level in range(TURNS):
            m.heating.turned_at[level] = PROGRESS_HIGH
            m.cooling.turned_at[level] = PROGRESS_HIGH
    else:
        m.heating.progress = progress_a(T, tau, p, e.spread * p.per_A_range)
        m.cooling.progress = progress_c(T, p)


@inlined
def rest_spring(
    s: Spring, T: float, loaded: float, longer: float, mount: Mounting, p: Constants, e: Effects
) -> None:
    """One spring at rest, all martensite: detwinned as far as its load says, and `longer` (m)."""
    force = loaded * mount.tension
    tau = p.C1 * force
    detwinned = loaded * (mount.xi_S + longer / p.delta_L)
    s.T_wire = T
    s.T_water = T
    s.T_wall = T
    s.xi_S_end = detwinned
    # What drains while the pump rests has drained.
    s.filled = p.wet * max(1.0 - e.drainage, p.drain_film)
    s.wetted = 1.0
    s.tension = force
    s.deflection = loaded * (mount.deflection + longer)
    s.resistance = p.resistance_per_m * p.length
    s.elastic_energy = 0.5 * force * force * compliance(1.0, p, e)
    s.tau = tau
    rest_memory(s.memory, detwinned, T, tau, p, e)
    for i in range(CELLS):
        rest_memory(s.cells[i], detwinned, T, tau, p, e)
    if e.r_width > 0.0:
        above = p.M_S + e.r_above - T
        s.r_progress = clip01(above / e.r_width)


@entry
def rest(
    states: OneRecord, models: OneRecord, mounts: OneRecord, ring: npt.NDArray[np.float64]
) -> None:
    """Make the state of a plant at rest of one that is all zero, sensors included."""
    state, model, mount = states[0], models[0], mounts[0]
    state.shared.given_inlet = mount.T_inlet
    state.shared.given_air = mount.T_air
    rest_spring(state.x, mount.T_x, mount.loads_x, -mount.displacement, mount, model.p, model.x)
    rest_spring(state.y, mount.T_y, mount.loads_y, mount.displacement, mount, model.p, model.y)
    state.shared.displacement = mount.displacement
    state.shared.slip_from = mount.displacement
    state.shared.play = mount.displacement
    state.shared.tension = state.x.tension
    wake_sensors(state, model, ring)
    state.shared.samples = 0.0
