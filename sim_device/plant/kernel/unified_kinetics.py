"""Effect unified_kinetics: one law for all martensite, which remembers where it turned.

Stress shifts both transformations along their own lines; what forms is detwinned in part, and what
is there is detwinned further. On each branch the outer curve is scaled so that it passes through
the points where such legs turned before (docs/decisions/0103).
"""

from __future__ import annotations

import math

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.curves import (
    Row,
    clip01,
    interpolate_outer_curve,
    remaining,
    remaining_slope,
)
from sim_device.plant.kernel.model import PROGRESS_HIGH, PROGRESS_LOW, Constants, Effects
from sim_device.plant.kernel.state import TURNS, Curve, Leg, Memory, PartWork, SpringWork


@inlined
def hold_progress(progress: float) -> float:
    """Progress where it still matters: curves with tails go beyond 0 and 1."""
    if progress <= PROGRESS_LOW:
        return PROGRESS_LOW
    if progress >= PROGRESS_HIGH:
        return PROGRESS_HIGH
    return progress


@inlined
def transformation_starts(tau: float, p: Constants) -> tuple[float, float]:
    """Where heating and cooling begin to transform at a stress, K. M_S is at the mount's stress."""
    cold = p.M_S + (tau - p.C1 * p.F0) / p.C_M
    return p.A_S + tau * p.per_C_A, cold


@inlined
def heating_progress(T: float, hot: float, p: Constants) -> float:
    """a at a temperature, from where heating begins to transform."""
    return hold_progress((T - hot) * p.per_A_range)


@inlined
def cooling_progress(T: float, cold: float, p: Constants) -> float:
    """c at a temperature, from where cooling begins to transform."""
    return hold_progress((cold - T) * p.per_M_range)


@inlined
def detwinned_share(tau: float, p: Constants) -> tuple[float, float]:
    """How much of all martensite a stress detwins, 1 - f(b) of Eq. (12), and its slope with F."""
    left = remaining(clip01((tau - p.tau_start) * p.per_tau_range))
    return 1.0 - left, -remaining_slope(left) * p.per_tau_range * p.C1


@inlined
def set_lines(F: float, w: SpringWork, p: Constants) -> None:
    """What a tension does to the whole spring's kinetics, into scratch."""
    w.heating_start, w.cooling_start = transformation_starts(p.C1 * F, p)
    w.detwinned, w.detwinned_by_F = detwinned_share(p.C1 * F, p)


@inlined
def copy_lines(w: SpringWork, other: SpringWork) -> None:
    """The same for a spring at the same tension: its material is the same."""
    other.heating_start = w.heating_start
    other.cooling_start = w.cooling_start
    other.detwinned = w.detwinned
    other.detwinned_by_F = w.detwinned_by_F


@inlined
def curve_at_begin(leg: Leg, known: Curve, curve: Row) -> float:
    """The outer curve where a leg began, worked out once in a substep when it is needed."""
    if known.begin < 0.0:
        known.begin = interpolate_outer_curve(leg.progress, curve)[0]
    return float(known.begin)


@inlined
def curve_at_turn(leg: Leg, known: Curve, curve: Row) -> float:
    """The same where such a leg turned last."""
    if known.turn < 0.0:
        known.turn = interpolate_outer_curve(leg.turned_at[0], curve)[0]
    return float(known.turn)


@inlined
def rate_around(value: float, target: float, inside: int, leg: Leg, curve: Row) -> float:
    """How what is left follows the outer curve on the way around a loop that closes at `target`.

    That is the leg before the loop's turn, which ends at turn `inside` or with the outer curve; of
    what is no loop the outer curve itself.
    """
    if inside == 0:
        return 1.0
    there = 0.0
    left_there = 0.0
    if inside < TURNS and leg.turned_at[inside] < PROGRESS_HIGH:
        there = interpolate_outer_curve(leg.turned_at[inside], curve)[0]
        left_there = min(leg.left_there[inside], value)
    # Where the outer curve has ended both turns are at its end: then nothing is bounded.
    return (value - left_there) / max(target - there, 1e-12)


@inlined
def remaining_on_branch(
    now: float, x: float, leg: Leg, other: Leg, known: Curve, curve: Row, e: Effects
) -> tuple[float, float]:
    """What is left of a fraction `x` at progress `now`, and its slope.

    The outer curve, scaled to pass through `x` at the furthest progress so far and through the
    points where such legs turned before (`leg`), so that every loop closes, a ripple's too. Effect
    minor_loop raises the share of the way that is left: by `kappa` as in the paper's kinetics, the
    share that had not transformed when the leg began being kept in `other`, and by the share that
    rests until the curve around it is reached: of a loop the leg that it turned from, else the
    outer curve.
    """
    begin = curve_at_begin(leg, known, curve)
    now_left, now_slope = interpolate_outer_curve(now, curve)
    value = 0.0
    target = 0.0
    began = 0.0
    inside = 0
    for level in range(TURNS):
        point = leg.turned_at[level]
        began = other.left_there[level] if other.turned_at[level] < PROGRESS_HIGH else 0.0
        if point >= PROGRESS_HIGH:
            break
        if leg.progress < point:
            if level == 0:
                there = curve_at_turn(leg, known, curve)
            else:
                there = interpolate_outer_curve(point, curve)[0]
            if begin > there:
                value = leg.left_there[level]
                target = there
                inside = level + 1
                if now < point:
                    break
                x = min(x, value)
                begin = target
                value = 0.0
                target = 0.0
                inside = 0
    exponent = (1.0 - e.minor_memory) * (1.0 + e.minor_kappa * began)
    # Rounding may leave a fraction that rests at a turn's below it.
    value = min(value, x)
    part = 1.0 / (begin - target)
    ratio = (now_left - target) * part
    slope = (x - value) * now_slope * part
    if exponent == 1.0 or ratio <= 0.0:
        return value + (x - value) * ratio, slope
    raised = math.pow(ratio, exponent)
    left = value + (x - value) * raised
    # Curves with tails cross: what lies beyond the curve around already goes along beside it.
    around = max(rate_around(value, target, inside, leg, curve), (x - value) * part)
    bound = value + around * (now_left - target)
    if bound < left:
        return bound, around * now_slope
    return left, slope * exponent * raised / ratio


@inlined
def unified_fractions(
    T: float, w: SpringWork, m: Memory, c: PartWork, p: Constants, e: Effects
) -> tuple[float, float, float, float, float, float]:
    """(ξ_S, ξ_T, dξ/dT, dξ/dF, dξ_S/dT, dξ_S/dF) at T and the tension `set_lines` was given."""
    xs = m.xi_S
    xi = xs + m.xi_T
    xi_T = 0.0
    xi_F = 0.0
    xs_T = 0.0
    xs_F = 0.0
    a = heating_progress(T, w.heating_start, p)
    if a > m.heating.progress and xi > 0.0:
        left, slope = remaining_on_branch(
            a, xi, m.heating, m.cooling, c.heating, e.curves.heating, e
        )
        if left < xi:
            share = xs / xi
            xi_T = slope * p.per_A_range
            xi_F = -xi_T * p.C1 * p.per_C_A
            xs_T = share * xi_T
            xs_F = share * xi_F
            xs = share * left
            xi = left
    cooled = cooling_progress(T, w.cooling_start, p)
    if cooled > m.cooling.progress and xi < 1.0:
        left, slope = remaining_on_branch(
            cooled, 1.0 - xi, m.cooling, m.heating, c.cooling, e.curves.cooling, e
        )
        more = 1.0 - left - xi
        if more > 0.0:
            grown_T = slope * p.per_M_range
            grown_F = -grown_T * p.C1 / p.C_M
            xs_T += w.detwinned * grown_T
            xs_F += w.detwinned * grown_F + w.detwinned_by_F * more
            # Where both lines are passed in one substep, of what has gone a part comes back.
            share_left = left / (1.0 - xi)
            xi_T = share_left * xi_T + grown_T
            xi_F = share_left * xi_F + grown_F
            xs += w.detwinned * more
            xi = 1.0 - left
    if w.detwinned * xi > xs:
        xs = w.detwinned * xi
        xs_T = w.detwinned * xi_T
        xs_F = w.detwinned * xi_F + w.detwinned_by_F * xi
    return xs, xi - xs, xi_T, xi_F, xs_T, xs_F


@inlined
def branch_bounds(target: float, w: SpringWork, m: Memory, p: Constants) -> tuple[float, float]:
    """Between which temperatures a part ends that would end at `target` without latent heat.

    Between the lines from which it transforms on it rests, and ends there. Beyond one of them its
    latent heat pulls it back towards that line, but not over it.
    """
    up = w.heating_start + m.heating.progress / p.per_A_range + w.T_shift
    down = w.cooling_start - m.cooling.progress / p.per_M_range + w.T_shift
    return min(target, up), max(target, down)


@inlined
def push_turn(leg: Leg, progress: float, left: float) -> None:
    """Remember a turn before the others; the last one is forgotten."""
    for level in range(TURNS - 1, 0, -1):
        leg.turned_at[level] = leg.turned_at[level - 1]
        leg.left_there[level] = leg.left_there[level - 1]
    leg.turned_at[0] = progress
    leg.left_there[0] = left


@inlined
def pop_turn(leg: Leg) -> None:
    """Forget the latest turn."""
    for level in range(TURNS - 1):
        leg.turned_at[level] = leg.turned_at[level + 1]
        leg.left_there[level] = leg.left_there[level + 1]
    leg.turned_at[TURNS - 1] = PROGRESS_HIGH
    leg.left_there[TURNS - 1] = 0.0


@inlined
def follow_leg(x: float, end: float, progress: float, back: float, leg: Leg, other: Leg) -> bool:
    """One substep of a leg on which `x` falls; True when it turns out to have ended before.

    `own.progress` is the furthest progress of the leg, `other.progress` that on the way back from
    there. `end` is what was left at the furthest point; more than that is a turn, which is kept,
    however small: a threshold here would make what follows jump with the parameters. Of more turns
    than there is room for the innermost loop is forgotten.
    """
    if progress > leg.progress:
        leg.progress = progress
        other.progress = back
    elif back > other.progress:
        other.progress = back
    if x > end:
        if leg.turned_at[TURNS - 1] < PROGRESS_HIGH:
            pop_turn(leg)
            pop_turn(other)
        push_turn(leg, leg.progress, end)
        leg.progress = progress
        return True
    for _ in range(TURNS):
        if leg.turned_at[0] >= PROGRESS_HIGH or leg.progress < leg.turned_at[0]:
            break
        pop_turn(leg)
        pop_turn(other)
    return False


@inlined
def remember_turns(m: Memory, xi: float, a: float, c: float) -> None:
    """What has to be remembered of a substep that ends at the fraction `xi`."""
    end = m.xi_turn
    if m.direction < 0.0:
        ended = follow_leg(xi, end, a, c, m.heating, m.cooling)
        further = xi < end
    else:
        ended = follow_leg(1.0 - xi, 1.0 - end, c, a, m.cooling, m.heating)
        further = xi > end
    if ended:
        m.direction = -m.direction
    if ended or further:
        m.xi_turn = xi
