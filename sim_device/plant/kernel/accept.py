"""Taking over the end of a substep: state, energy books, and what has to be remembered."""

from __future__ import annotations

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.curves import clip01, remaining
from sim_device.plant.kernel.front import spread_latent_heat
from sim_device.plant.kernel.heat import book_heat
from sim_device.plant.kernel.mechanics import end_fraction
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.paper_kinetics import progress_a, progress_b, progress_c
from sim_device.plant.kernel.parts import count_parts, memory_of, rise_by_latent_heat, work_of
from sim_device.plant.kernel.state import Shared, Spring, SpringWork
from sim_device.plant.kernel.unified_kinetics import (
    cooling_progress,
    heating_progress,
    remember_turns,
    transformation_starts,
)

# R-phase: reverts so far above where it began, K.
R_HYSTERESIS = 2.0


@inlined
def update_r_phase(xi_old: float, xi: float, s: Spring, p: Constants, e: Effects) -> None:
    """Effect r_phase: austenite becomes R-phase on cooling, and back with a small hysteresis."""
    T = s.T_wire
    start = p.M_S + e.r_above
    austenite = 1.0 - xi
    share = s.r_fraction / (1.0 - xi_old) if xi_old < 1.0 else 0.0
    progress = clip01((start - T) / e.r_width)
    if xi < xi_old:
        # Austenite that heating has just made holds no R-phase.
        share = s.r_fraction / austenite if austenite > 0.0 else 0.0
    if progress > s.r_progress:
        ratio = remaining(progress) / remaining(s.r_progress)
        share = 1.0 - (1.0 - share) * ratio
    top = 1.0 - remaining((start + R_HYSTERESIS - T) / e.r_width)
    share = min(share, top)
    s.r_progress = progress
    s.r_fraction = share * austenite


@inlined
def remember_transformation(s: Spring, w: SpringWork, p: Constants, e: Effects, dt: float) -> None:
    """Progress and legs of the spring or of its cells, and what their latent heat does to them.

    At the temperature of the last evaluation, so that progress and fractions belong together.
    """
    tau = p.C1 * w.F_phase
    parts = count_parts(e)
    hot, cold = transformation_starts(tau, p)
    released = 0.0
    for i in range(parts):
        m, c = memory_of(i, parts, s), work_of(i, parts, w)
        xi_old = m.xi_S + m.xi_T
        change = c.xi_S + c.xi_T - xi_old
        m.xi_S = c.xi_S
        m.xi_T = c.xi_T
        before = s.T_wire + e.front * s.wire_off[i]
        s.cell_rate[i] = (c.T_wire - before) / dt
        w.cells[i].own_rise = rise_by_latent_heat(change, w) * change
        released += w.cells[i].own_rise / parts
        T = c.T_wire - w.T_shift
        if e.unified > 0.0:
            a = heating_progress(T, hot, p)
            remember_turns(m, xi_old + change, a, cooling_progress(T, cold, p))
            continue
        m.heating.progress = progress_a(T, tau, p, e.spread * p.per_A_range)
        m.stress_progress = progress_b(T, tau, p)
        m.cooling.progress = progress_c(T, p)
        if change != 0.0:
            direction = -1.0 if change < 0.0 else 1.0
            if direction != m.direction:
                m.direction = direction
                m.xi_turn = xi_old
    if parts > 1:
        spread_latent_heat(s, w, p, released, dt)


@compiled
def accept_substep(
    F_spring: float, s: Spring, w: SpringWork, g: Shared, p: Constants, e: Effects, dt: float
) -> None:
    """Take over the end of the substep for one spring at its tension, and write its books."""
    T_old = s.T_wire
    xi_old = s.memory.xi_S + s.memory.xi_T
    change = w.xi_S + w.xi_T - xi_old
    remember_transformation(s, w, p, e, dt)
    if w.fed == 0.0 or e.front > 0.0:
        book_heat(s, w, g, p, e, change, dt)
    work = 0.5 * (F_spring + s.tension) * (w.deflection - s.deflection)
    elastic = 0.5 * F_spring * F_spring * w.compliance
    lost = work - elastic + s.elastic_energy
    s.elastic_energy = elastic
    s.work_on += work
    s.omitted_work += (1.0 - p.work_share) * lost
    s.work_heat = p.work_share * lost * p.per_length
    s.T_wire_rate = (w.T_end - T_old) / dt
    s.transforms = 1.0 if change != 0.0 else 0.0
    s.fraction_rate = change / dt
    s.T_wire = w.T_end
    s.memory.xi_S = w.xi_S
    s.memory.xi_T = w.xi_T
    s.tension = F_spring
    s.deflection = w.deflection
    s.tau = p.C1 * w.F_phase
    s.cycles += 0.5 * abs(change)
    if e.cold_ends > 0.0:
        s.xi_S_end = end_fraction(w.F_phase, s, p)[0]
    if e.r_strain != 0.0 or e.r_resistivity != 0.0:
        update_r_phase(xi_old, xi_old + change, s, p, e)
    g.rounds += w.rounds


@inlined
def accept_motion(g: Shared, u: float, F: float, dt: float) -> None:
    """Take over displacement and tension of the tendon at the end of the substep."""
    g.speed = (u - g.displacement) / dt
    g.displacement = u
    g.tension_rate = (F - g.tension) / dt
    g.tension = F
