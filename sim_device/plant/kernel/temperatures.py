"""Temperatures of a spring's parts at one tension: what the heat balance asks of T and ξ together.

Part i ends at T_i = B + s (D_i + λ_i Δξ_i): D_i its distance from the mean along a front of share
s, λ_i Δξ_i its own latent heat (of a spring without a front: one part, D = 0, s = 1).
B = T* + λ m - s M, with m and M the means of Δξ_i and λ_i Δξ_i, makes the mean of T_i what the heat
balance says, T* + λ m, or what is fed. Each side of it rises with B, so that there is one root.
"""

from __future__ import annotations

import math

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.mechanics import deflect_along_step
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.parts import (
    change_of,
    count_parts,
    evaluate_fractions,
    memory_of,
    rise_by_latent_heat,
    work_of,
)
from sim_device.plant.kernel.state import Memory, PartWork, Spring, SpringWork
from sim_device.plant.kernel.unified_kinetics import branch_bounds, copy_lines, set_lines

T_TOLERANCE = 1e-8  # K
# Where a fraction is steep, rounding leaves a larger miss at the very temperature, K.
LEAST_STEP = 1e-12
ITERATIONS = 200
NEWTON_STEPS = 4  # before temperatures are held in brackets
SMOOTH_NEWTON_STEPS = 30  # the same of the paper's kinetics in a bracket
UNBOUNDED = 1e300


@inlined
def trusted_steps(e: Effects) -> int:
    """How many steps Newton's method may make in a bracket before it has to prove itself."""
    return NEWTON_STEPS if e.unified > 0.0 else SMOOTH_NEWTON_STEPS


@inlined
def safeguarded_newton_step(
    trusted: bool, x: float, miss: float, last: float, slope: float, low: float, high: float
) -> float:
    """Newton's next place for a root in a bracket, or the middle of the bracket.

    The middle where Newton leaves the bracket, and where it has not halved the miss since `last`,
    unless it is `trusted`: at a kink it would go to and fro inside the bracket.
    """
    step = x - miss / slope
    if low < step < high and (trusted or abs(miss) <= 0.5 * abs(last)):
        return step
    return 0.5 * (low + high)


@inlined
def step_across(x: float, miss: float, low: float, high: float) -> float:
    """Half a tolerance across the root, where the slope is so steep that Newton's step is less.

    The bracket is closed then. The middle of the bracket where it does not reach so far.
    """
    step = x - math.copysign(0.5 * T_TOLERANCE, miss)
    return step if low < step < high else 0.5 * (low + high)


@compiled
def solve_part_temperature(
    base: float, s: Spring, w: SpringWork, m: Memory, c: PartWork, p: Constants, e: Effects
) -> float:
    """The temperature of a part: the one root of T = base + s λ (ξ(T) - ξ_old), in a bracket.

    Returns the change of its fraction.
    """
    share = w.front_share
    low = base - share * w.cell_lam_heating
    high = base + share * w.cell_lam_cooling
    T = c.T_wire
    if not low <= T <= high:
        T = base
    change = miss = lam = 0.0
    branches = e.unified > 0.0
    last = UNBOUNDED
    trusted = trusted_steps(e)
    for n in range(ITERATIONS):
        change, xi_T = evaluate_fractions(T, s, w, m, c, p, e)
        lam = share * rise_by_latent_heat(change, w)
        miss = T - base - lam * change
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            break
        if miss > 0.0:
            high = T
        else:
            low = T
        slope = 1.0 - lam * xi_T
        steep = 0.5 * T_TOLERANCE * slope
        if branches and abs(miss) < steep:
            T = step_across(T, miss, low, high)
        else:
            T = safeguarded_newton_step(n < trusted, T, miss, last, slope, low, high)
        last = miss
    c.T_wire = T
    if branches and lam > 0.0 and abs(miss) > T_TOLERANCE:
        # The fraction is so steep that the temperature cannot tell it; the heat balance does.
        return (T - base) / lam
    return change


@compiled
def solve_part_temperatures(s: Spring, w: SpringWork, p: Constants, e: Effects) -> bool:
    """The temperatures of all parts at one tension, in brackets; False if they are not found."""
    star = w.T_star
    parts = count_parts(e)
    each = 1.0 / parts
    share = w.front_share
    low = star - w.lam_heating - share * w.cell_lam_cooling
    high = star + w.lam_cooling + share * w.cell_lam_heating
    base = star
    last = UNBOUNDED
    trusted = trusted_steps(e)
    for n in range(ITERATIONS):
        mean = 0.0
        latent_mean = 0.0
        for i in range(parts):
            m, c = memory_of(i, parts, s), work_of(i, parts, w)
            goal = base + share * s.wire_off[i]
            change = solve_part_temperature(goal, s, w, m, c, p, e)
            mean += change * each
            latent_mean += rise_by_latent_heat(change, w) * change * each
        lam = w.lam_heating if mean < 0.0 else w.lam_cooling
        miss = base - star - lam * mean + share * latent_mean
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            return True
        if miss > 0.0:
            high = base
        else:
            low = base
        steep = 1.0
        for i in range(parts):
            m, c = memory_of(i, parts, s), work_of(i, parts, w)
            rise = share * rise_by_latent_heat(change_of(m, c), w)
            steep += (rise - lam) * c.xi_by_T / (1.0 - rise * c.xi_by_T) * each
        base = safeguarded_newton_step(n < trusted, base, miss, last, steep, low, high)
        last = miss
    return False


@inlined
def keep_to_branch(
    step: float, T: float, target: float, w: SpringWork, m: Memory, p: Constants
) -> float:
    """Newton's step of a part, shortened where it would pass the line it comes to an end beside.

    The slope changes there by the whole latent heat, so that Newton's method would go to and fro
    between the two sides. `target` is where the part would end without its latent heat.
    """
    low, high = branch_bounds(target, w, m, p)
    if low <= T + step <= high:
        return step
    if not low < T < high:
        return 0.5 * (low + high) - T
    return 0.5 * ((low if step < 0.0 else high) - T)


@compiled
def step_spring(s: Spring, w: SpringWork, p: Constants, e: Effects) -> None:
    """Evaluate a spring at the guesses of its parts' temperatures, and make one step of Newton.

    At the tension that `set_tension` was given. Fractions, deflection, extrapolated along the step,
    and its slope go to the scratch; `miss` is the size of the step in temperature, 0 if there was
    nothing to step. So temperatures and tension can converge together.
    """
    parts = count_parts(e)
    each = 1.0 / parts
    share = w.front_share
    xs = xt = mean = latent_mean = 0.0
    for i in range(parts):
        m, c = memory_of(i, parts, s), work_of(i, parts, w)
        change, _ = evaluate_fractions(c.T_wire, s, w, m, c, p, e)
        xs += c.xi_S * each
        xt += c.xi_T * each
        mean += change * each
        latent_mean += rise_by_latent_heat(change, w) * change * each
    lam = w.lam_heating if mean < 0.0 else w.lam_cooling
    base = w.T_star + lam * mean - share * latent_mean
    # One step of Newton in all temperatures, and how they follow the force.
    worst = coupled = pulled = forced = 0.0
    for i in range(parts):
        m, c = memory_of(i, parts, s), work_of(i, parts, w)
        change = change_of(m, c)
        rise = share * rise_by_latent_heat(change, w)
        miss = c.T_wire - rise * change - base - share * s.wire_off[i]
        worst = max(worst, abs(miss))
        part = (lam - rise) / (1.0 - rise * c.xi_by_T) * each
        coupled += part * c.xi_by_T
        pulled -= part * c.xi_by_T * miss
        forced += part * c.xi_by_F
    step = pulled / (1.0 - coupled)
    base_F = forced / (1.0 - coupled)
    rough = worst > T_TOLERANCE
    xi_step = xs_step = xi_F = xs_F = largest = 0.0
    for i in range(parts):
        m, c = memory_of(i, parts, s), work_of(i, parts, w)
        change = change_of(m, c)
        rise = share * rise_by_latent_heat(change, w)
        eased = 1.0 / (1.0 - rise * c.xi_by_T)
        T_F = (base_F + rise * c.xi_by_F) * eased
        c.T_by_F = T_F
        xi_F += (c.xi_by_F + c.xi_by_T * T_F) * each
        xs_F += (c.xi_S_by_F + c.xi_S_by_T * T_F) * each
        if rough:
            miss = c.T_wire - rise * change - base - share * s.wire_off[i]
            own_step = (step - miss) * eased
            if e.unified > 0.0:
                target = base + step + share * s.wire_off[i]
                own_step = keep_to_branch(own_step, c.T_wire, target, w, m, p)
            xi_step += c.xi_by_T * own_step * each
            xs_step += c.xi_S_by_T * own_step * each
            c.T_wire += own_step
            largest = max(largest, abs(own_step))
    w.miss = worst if largest > LEAST_STEP else 0.0
    w.T_end = w.T_star + lam * mean
    w.xi_S = xs
    w.xi_T = xt
    deflect_along_step(w.F_phase, (xi_step, xs_step), (xi_F, xs_F), s, w, p, e)


@compiled
def solve_spring(s: Spring, w: SpringWork, p: Constants, e: Effects) -> bool:
    """The temperatures that the heat balance asks for at the tension `set_tension` was given.

    In the end held in brackets; False when they are not found. Fractions, deflection and its slope
    go to the scratch.
    """
    solved = True
    for n in range(NEWTON_STEPS + 1):
        if n == NEWTON_STEPS:
            solved = solve_part_temperatures(s, w, p, e)
        step_spring(s, w, p, e)
        if w.miss == 0.0:
            return True
    w.miss = 0.0
    return solved


@inlined
def set_tension(F: float, w: SpringWork, p: Constants, e: Effects) -> None:
    """What a tension does to the whole spring's kinetics, into scratch."""
    w.F_phase = F
    if e.unified > 0.0:
        set_lines(F, w, p)


@inlined
def copy_tension(w: SpringWork, other: SpringWork) -> None:
    """The same for a spring at the same tension: its material is the same."""
    other.F_phase = w.F_phase
    copy_lines(w, other)


@inlined
def follow_tension(dF: float, w: SpringWork, e: Effects) -> None:
    """Move the guesses of temperature along with a step of the tension."""
    parts = count_parts(e)
    for i in range(parts):
        c = work_of(i, parts, w)
        c.T_wire += dF * c.T_by_F
