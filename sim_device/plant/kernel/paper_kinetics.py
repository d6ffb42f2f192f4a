"""The paper's kinetics, Eqs (11)-(13), in rate form.

Each transformation has a progress (a, b, c). A fraction that is left to transform scales by
f(new)/f(old) whenever its progress grows, and rests otherwise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.curves import clip01, remaining, remaining_slope, remaining_spread
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.state import Memory, PartWork, Spring


class Fractions(NamedTuple):
    """Detwinned and twinned martensite, and their slopes with temperature and tension."""

    xi_S: float
    xi_T: float
    S_by_T: float
    S_by_F: float
    T_by_T: float
    T_by_F: float


@inlined
def progress_a(T: float, tau: float, p: Constants, spread: float) -> float:
    """Progress of the reverse transformation, Eq. (11); beyond 0 to 1 where temperatures spread."""
    value = (T - p.A_S - tau * p.per_C_A) * p.per_A_range
    if value <= -spread:
        return -spread
    if value >= 1.0 + spread:
        return 1.0 + spread
    return float(value)


@inlined
def progress_b(T: float, tau: float, p: Constants) -> float:
    """Progress of stress-induced martensite above M_S, Eq. (13), and of detwinning, Eq. (12)."""
    above = T - p.M_S
    if above > 0.0:
        tau = tau - p.C_M * above
    return clip01((tau - p.tau_start) * p.per_tau_range)


@inlined
def progress_c(T: float, p: Constants) -> float:
    """Progress of twinned martensite on cooling, Eq. (12c)."""
    return clip01((p.M_S - T) * p.per_M_range)


@inlined
def f_a_at_start(m: Memory, c: PartWork, spread: float) -> float:
    """f(a) at the start of the substep, worked out once and only when it is needed."""
    if c.f_a < 0.0:
        if spread > 0.0:
            c.f_a = remaining_spread(m.heating.progress, spread)
        else:
            c.f_a = remaining(m.heating.progress)
    return float(c.f_a)


@inlined
def f_b_at_start(m: Memory, c: PartWork) -> float:
    """The same of f(b)."""
    if c.f_b < 0.0:
        c.f_b = remaining(m.stress_progress)
    return float(c.f_b)


@inlined
def f_c_at_start(m: Memory, c: PartWork) -> float:
    """The same of f(c)."""
    if c.f_c < 0.0:
        c.f_c = remaining(m.cooling.progress)
    return float(c.f_c)


@inlined
def raise_for_minor_loop(ratio: float, share: float, e: Effects) -> tuple[float, float]:
    """Effect minor_loop: the exponent, and the ratio raised to it, of a leg begun half way."""
    exponent = 1.0 + e.minor_kappa * share
    return exponent, math.pow(ratio, exponent)


@inlined
def rest_until_outer_curve(
    ratio: float,
    slope: float,
    left: float,
    left_slope: float,
    before: float,
    part: float,
    e: Effects,
) -> tuple[float, float]:
    """Effect minor_loop: a share of the wire rests until the outer curve reaches its fraction.

    `left` and `before` are the outer curve at the end and the start of the substep, `part` the
    fraction that is still to transform. Returns the ratio by which it shrinks, and its slope.
    """
    if part < before:
        outer = 1.0
        outer_slope = 0.0
        if left < part:
            outer = left / part
            outer_slope = left_slope / part
        ratio += e.minor_memory * (outer - ratio)
        slope += e.minor_memory * (outer_slope - slope)
    return ratio, slope


@inlined
def shrink_on_heating(
    a: float, spread: float, m: Memory, c: PartWork, e: Effects
) -> tuple[float, float]:
    """Eq. (11) in rate form. Returns the ratio by which both fractions shrink and its da-slope."""
    if spread > 0.0:
        left = remaining_spread(a, spread)
        slope = 0.5 * remaining_slope(remaining(a)) + 0.25 * (
            remaining_slope(remaining(a - spread)) + remaining_slope(remaining(a + spread))
        )
    else:
        left = remaining(a)
        slope = remaining_slope(left)
    before = f_a_at_start(m, c, spread)
    ratio = left / before
    outer_slope = slope
    slope = slope / before
    if e.minor_kappa != 0.0 and ratio > 0.0:
        exponent, raised = raise_for_minor_loop(ratio, 1.0 - c.xi_back, e)
        slope = slope * exponent * raised / ratio
        ratio = raised
    if e.minor_memory > 0.0:
        part = m.xi_S + m.xi_T
        ratio, slope = rest_until_outer_curve(ratio, slope, left, outer_slope, before, part, e)
    return ratio, slope


@inlined
def return_to_austenite(
    a: float, spread: float, m: Memory, c: PartWork, p: Constants, e: Effects
) -> Fractions:
    """Both fractions after Eq. (11)."""
    xs = m.xi_S
    xt = m.xi_T
    if a > m.heating.progress and xs + xt > 0.0:
        ratio, slope = shrink_on_heating(a, spread, m, c, e)
        slope = slope * p.per_A_range if a < 1.0 + spread else 0.0
        slope_F = -slope * p.C1 * p.per_C_A
        return Fractions(xs * ratio, xt * ratio, xs * slope, xs * slope_F, xt * slope, xt * slope_F)
    return Fractions(xs, xt, 0.0, 0.0, 0.0, 0.0)


@inlined
def detwin_between(
    old: Fractions, before: float, left: float, hot: bool, c: PartWork, e: Effects
) -> tuple[float, float]:
    """Fractions when f(b) falls from `before` to `left`: Eq. (13) above M_S, Eq. (12) below."""
    xs = old.xi_S
    xt = old.xi_T
    ratio = left / before if before > 0.0 else 1.0
    if e.minor_kappa != 0.0 and hot and ratio > 0.0:
        ratio = raise_for_minor_loop(ratio, c.xi_forth, e)[1]
    if e.minor_memory > 0.0 and hot:
        ratio = rest_until_outer_curve(ratio, 0.0, left, 0.0, before, 1.0 - xs, e)[0]
    new = 1.0 - (1.0 - xs) * ratio
    if not hot and 1.0 - left < new:
        new = 1.0 - left
    if new > xs:
        xt = xt * (1.0 - new) / (1.0 - xs)
        xs = new
    return xs, xt


@inlined
def detwin_across_M_S(
    tau: float,
    b: float,
    old: Fractions,
    s: Spring,
    m: Memory,
    c: PartWork,
    p: Constants,
    e: Effects,
) -> Fractions:
    """Fractions when the substep passes M_S: one rule up to there, the other from there.

    How far into the substep that is has been foreseen, so that the fractions stay monotone in
    temperature and force. The slope of ξ_S with the force is good enough for the few substeps
    concerned.
    """
    stress = s.tau + c.crossing * (tau - s.tau)
    middle = clip01((stress - p.tau_start) * p.per_tau_range)
    between = remaining(middle)
    xs_F = old.S_by_F
    now = old
    if middle > m.stress_progress:
        before = f_b_at_start(m, c)
        grown, xt = detwin_between(now, before, between, c.above_M_S > 0.0, c, e)
        if grown > now.xi_S and between > 0.0:
            steep = remaining_slope(between) * (1.0 - grown) / between
            xs_F = xs_F - steep * p.per_tau_range * p.C1 * c.crossing
        now = Fractions(grown, xt, old.S_by_T, xs_F, old.T_by_T, old.T_by_F)
    if b > middle:
        left = remaining(b)
        grown, xt = detwin_between(now, between, left, c.above_M_S == 0.0, c, e)
        if grown > now.xi_S and left > 0.0:
            steep = remaining_slope(left) * (1.0 - grown) / left
            xs_F = xs_F - steep * p.per_tau_range * p.C1 * (1.0 - c.crossing)
        now = Fractions(grown, xt, old.S_by_T, xs_F, old.T_by_T, old.T_by_F)
    return now


@inlined
def detwin(
    T: float, b: float, old: Fractions, m: Memory, c: PartWork, p: Constants, e: Effects
) -> Fractions:
    """Eq. (13) above M_S, Eq. (12) below: ξ_S grows with b, ξ_T shrinks as 1 - ξ_S does."""
    xs = old.xi_S
    left = remaining(b)
    before = f_b_at_start(m, c)
    ratio = left / before
    bend = 1.0
    hot = c.above_M_S > 0.0
    if e.minor_kappa != 0.0 and hot and ratio > 0.0:
        exponent, raised = raise_for_minor_loop(ratio, c.xi_forth, e)
        bend = exponent * raised / ratio
        ratio = raised
    if e.minor_memory > 0.0 and hot:
        ratio, bend = rest_until_outer_curve(ratio, bend / before, left, 1.0, before, 1.0 - xs, e)
        bend = bend * before
    new = 1.0 - (1.0 - xs) * ratio
    on_curve = c.above_M_S == 0.0 and 1.0 - left < new
    if on_curve:
        new = 1.0 - left
    if new <= xs:
        return old
    slope_F = 0.0
    slope_T = 0.0
    if b < 1.0:
        slope_F = remaining_slope(left) * p.per_tau_range * p.C1
        if p.M_S < T:
            slope_T = -slope_F / p.C1 * p.C_M
    free = 1.0 - xs
    if on_curve:
        ratio = left / free
        ratio_T = (slope_T + ratio * old.S_by_T) / free
        ratio_F = (slope_F + ratio * old.S_by_F) / free
    else:
        ratio_T = slope_T * bend / before
        ratio_F = slope_F * bend / before
    return Fractions(
        new,
        old.xi_T * ratio,
        ratio * old.S_by_T - free * ratio_T,
        ratio * old.S_by_F - free * ratio_F,
        ratio * old.T_by_T + old.xi_T * ratio_T,
        ratio * old.T_by_F + old.xi_T * ratio_F,
    )


@inlined
def revert_stress_induced(b: float, old: Fractions, p: Constants) -> Fractions:
    """Above the crossing of the A_F line and the M_S line nothing is metastable.

    Martensite that stress has made goes back along the forward curve. Not in the paper.
    """
    left = remaining(b)
    if old.xi_S <= 1.0 - left:
        return old
    xs_T = 0.0
    xs_F = 0.0
    if b > 0.0:
        slope_F = remaining_slope(left) * p.per_tau_range * p.C1
        xs_F = -slope_F
        xs_T = slope_F / p.C1 * p.C_M
    return Fractions(1.0 - left, old.xi_T, xs_T, xs_F, old.T_by_T, old.T_by_F)


@inlined
def form_twinned(
    c_end: float, old: Fractions, m: Memory, c: PartWork, p: Constants, e: Effects
) -> Fractions:
    """Eq. (12c): austenite becomes twinned martensite on cooling."""
    austenite = 1.0 - old.xi_S - old.xi_T
    if austenite <= 0.0:
        return old
    left = remaining(c_end)
    before = f_c_at_start(m, c)
    ratio = left / before
    slope = 0.0
    if c_end < 1.0:
        slope = -remaining_slope(left) / before * p.per_M_range
    outer_slope = slope * before
    if e.minor_kappa != 0.0 and ratio > 0.0:
        exponent, raised = raise_for_minor_loop(ratio, c.xi_forth, e)
        slope = slope * exponent * raised / ratio
        ratio = raised
    if e.minor_memory > 0.0:
        ratio, slope = rest_until_outer_curve(ratio, slope, left, outer_slope, before, austenite, e)
    return Fractions(
        old.xi_S,
        1.0 - old.xi_S - austenite * ratio,
        old.S_by_T,
        old.S_by_F,
        -old.S_by_T + ratio * (old.S_by_T + old.T_by_T) - austenite * slope,
        -old.S_by_F + ratio * (old.S_by_F + old.T_by_F),
    )


@inlined
def paper_fractions(
    T: float, F: float, s: Spring, m: Memory, c: PartWork, p: Constants, e: Effects
) -> Fractions:
    """Fractions at (T, F) from those at the start of the substep, with their slopes."""
    tau = p.C1 * F
    spread = e.spread * p.per_A_range
    a = progress_a(T, tau, p, spread)
    now = return_to_austenite(a, spread, m, c, p, e)
    b = progress_b(T, tau, p)
    if c.crossing > 0.0:
        now = detwin_across_M_S(tau, b, now, s, m, c, p, e)
    elif b > m.stress_progress and now.xi_S < 1.0:
        now = detwin(T, b, now, m, c, p, e)
    elif b < m.stress_progress and a >= 1.0 + spread and m.heating.progress >= 1.0 + spread:
        now = revert_stress_induced(b, now, p)
    c_end = progress_c(T, p)
    if c_end > m.cooling.progress:
        now = form_twinned(c_end, now, m, c, p, e)
    xt = min(now.xi_T, 1.0 - now.xi_S)
    xt = max(xt, 0.0)
    return Fractions(now.xi_S, xt, now.S_by_T, now.S_by_F, now.T_by_T, now.T_by_F)
