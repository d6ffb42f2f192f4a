"""Deflection and tension of one spring, the tendon, and what resists the motion: Eqs (2)-(10)."""

from __future__ import annotations

import math

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.curves import clip01, remaining, remaining_slope
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.state import Shared, Spring, SpringWork

REST_SPEED = 1e-9  # m/s


@inlined
def compliance(xi: float, p: Constants, e: Effects) -> float:
    """Elastic deflection per newton: Eq. (9) with (7); effect cold_ends in series."""
    soft = p.k_A - p.k_M
    give = 1.0 / (p.k_A - soft * xi)
    if e.cold_ends > 0.0:
        give = (1.0 - e.cold_ends) * give + e.cold_ends / p.k_M
    return float(give)


@inlined
def end_fraction(F: float, s: Spring, p: Constants) -> tuple[float, float]:
    """Detwinned fraction of ends that stay cold, and its slope: Eq. (12) on the curve."""
    b = clip01((p.C1 * F - p.tau_start) * p.per_tau_range)
    left = remaining(b)
    if 1.0 - left > s.xi_S_end:
        return 1.0 - left, -remaining_slope(left) * p.per_tau_range * p.C1
    return s.xi_S_end, 0.0


@inlined
def inelastic_deflection(
    F: float, xi_S: float, s: Spring, p: Constants, e: Effects
) -> tuple[float, float, float]:
    """Deflection at no load and its slopes with ξ_S and F: δ_L ξ_S, and what effects and
    a forcing add."""
    reach = p.delta_L
    if e.adds_strain == 0.0:
        return reach * xi_S + s.forced_deflection, reach, 0.0
    reach = reach * max(1.0 - e.fatigue_shrink * s.cycles, 0.0)
    extra = e.r_strain * p.delta_L * s.r_fraction + e.elongation * s.cycles + s.forced_deflection
    if e.cold_ends > 0.0:
        end, end_F = end_fraction(F, s, p)
        part = (1.0 - e.cold_ends) * reach
        cold = e.cold_ends * reach
        return part * xi_S + cold * end + extra, part, cold * end_F
    return reach * xi_S + extra, reach, 0.0


@inlined
def deflect_along_step(
    F: float,
    step: tuple[float, float],
    by_F: tuple[float, float],
    s: Spring,
    w: SpringWork,
    p: Constants,
    e: Effects,
) -> None:
    """Deflection at tension F with the fractions in scratch, and its slope with F, into scratch.

    ξ and ξ_S are still to make the steps given; `by_F` is how they follow the tension, the
    temperature with them.
    """
    xi = w.xi_S + w.xi_T
    give = compliance(xi, p, e)
    w.compliance = give
    soft = p.k_A - p.k_M
    plain = give
    weight = 1.0
    if e.cold_ends > 0.0:
        weight = 1.0 - e.cold_ends
        plain = 1.0 / (p.k_A - soft * xi)
    left, left_S, left_F = inelastic_deflection(F, w.xi_S, s, p, e)
    softer = F * soft * weight * plain * plain
    w.deflection = F * give + left + softer * step[0] + left_S * step[1]
    w.deflection_by_F = give + softer * by_F[0] + left_S * by_F[1] + left_F


@inlined
def deflect_frozen(F: float, s: Spring, w: SpringWork, p: Constants, e: Effects) -> None:
    """Deflection of a spring at tension F with the fractions in scratch, into scratch: Eq. (9)."""
    left = inelastic_deflection(F, w.xi_S, s, p, e)[0]
    w.deflection = F * compliance(w.xi_S + w.xi_T, p, e) + left


@inlined
def tension_at(deflection: float, s: Spring, w: SpringWork, p: Constants, e: Effects) -> float:
    """Tension at a deflection with the fractions in scratch, Eq. (9); never below 0."""
    left = inelastic_deflection(s.tension, w.xi_S, s, p, e)[0]
    F = (deflection - left) / compliance(w.xi_S + w.xi_T, p, e)
    w.deflection = deflection
    return F if F > 0.0 else 0.0


@inlined
def stretch_of_tendon(F: float, e: Effects) -> tuple[float, float]:
    """Half the stretch of the tendon at tension F, m, and its slope: slack taken up, compliance."""
    reach = 0.5 * e.tendon_compliance * F
    slope = 0.5 * e.tendon_compliance
    if e.tendon_slack > 0.0:
        decay = math.exp(-F / e.slack_force)
        reach += 0.5 * e.tendon_slack * (1.0 - decay)
        slope += 0.5 * e.tendon_slack * decay / e.slack_force
    return reach, slope


@inlined
def friction_at(F: float, speed: float, e: Effects) -> float:
    """Friction of tube on spring at a tension and a speed: constant, proportional, Stribeck."""
    level = e.coulomb + e.proportional_friction * F
    if e.stribeck > 0.0 and level > 0.0:
        level = level * (1.0 + e.stribeck * math.exp(-abs(speed) / e.stribeck_speed))
    return float(level)


@inlined
def resistance_to_motion(F: float, u: float, g: Shared, e: Effects, dt: float) -> float:
    """Force by which X must outpull Y at a displacement and its rate: effects of mechanics."""
    speed = (u - g.displacement) / dt
    push = e.pair_stiffness * u + e.pair_drag * speed
    if abs(speed) > REST_SPEED:
        push += math.copysign(friction_at(F, speed, e), speed)
    return float(push)


@inlined
def slack_position(u: float, wx: SpringWork, wy: SpringWork, p: Constants) -> float:
    """Where the encoder stands when the tendon is slack: where it was, between the spring ends."""
    low = p.delta_0 - wx.deflection
    high = wy.deflection - p.delta_0
    if u < low:
        return float(low)
    if u > high:
        return float(high)
    return u
