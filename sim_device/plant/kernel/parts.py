"""The parts of a spring that have kinetics of their own: the whole, or each of its cells."""

from __future__ import annotations

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.paper_kinetics import paper_fractions
from sim_device.plant.kernel.state import CELLS, Memory, PartWork, Spring, SpringWork
from sim_device.plant.kernel.unified_kinetics import unified_fractions


@inlined
def count_parts(e: Effects) -> int:
    """How many parts of a spring have kinetics of their own."""
    return CELLS if e.front > 0.0 else 1


@inlined
def memory_of(i: int, parts: int, s: Spring) -> Memory:
    """What part `i` of so many remembers."""
    return s.memory if parts == 1 else s.cells[i]


@inlined
def work_of(i: int, parts: int, w: SpringWork) -> PartWork:
    """What part `i` of so many scratches down."""
    return w.whole if parts == 1 else w.cells[i]


@inlined
def evaluate_fractions(
    T_wire: float, s: Spring, w: SpringWork, m: Memory, c: PartWork, p: Constants, e: Effects
) -> tuple[float, float]:
    """Fractions of a part at a temperature and at `F_phase`, with their slopes, into scratch.

    Returns the change of the martensite fraction in this substep, and its slope with the
    temperature.
    """
    T = T_wire - w.T_shift
    if e.unified > 0.0:
        c.xi_S, c.xi_T, c.xi_by_T, c.xi_by_F, c.xi_S_by_T, c.xi_S_by_F = unified_fractions(
            T, w, m, c, p, e
        )
    else:
        now = paper_fractions(T, w.F_phase, s, m, c, p, e)
        c.xi_S = now.xi_S
        c.xi_T = now.xi_T
        c.xi_by_T = now.S_by_T + now.T_by_T
        c.xi_by_F = now.S_by_F + now.T_by_F
        c.xi_S_by_T = now.S_by_T
        c.xi_S_by_F = now.S_by_F
    w.rounds += 1.0
    return change_of(m, c), c.xi_by_T


@inlined
def change_of(m: Memory, c: PartWork) -> float:
    """Change of the martensite fraction of a part in this substep, at its last evaluation."""
    return c.xi_S + c.xi_T - m.xi_S - m.xi_T


@inlined
def rise_by_latent_heat(change: float, w: SpringWork) -> float:
    """Kelvin per unit of fraction of a part, in the direction in which it transforms."""
    return float(w.cell_lam_heating if change < 0.0 else w.cell_lam_cooling)
