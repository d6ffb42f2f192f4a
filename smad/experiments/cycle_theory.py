"""The four steps of a cycle in closed form, Eqs (29)–(36), for the spring that is stretched first.

Independent of the plant's solver: only the printed equations, with the third ξ term of Eq. (35)
left out (it is spurious) and Eq. (12) taken as the characteristic curve itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from sim_device.plant.parameters import ParameterSet, initial_detwinned, spring_factors
from smad.arrays import Array

POINTS = 200
F = TypeVar("F", float, Array)


@dataclass(frozen=True)
class CycleTheory:
    """The path of spring Y while X is heated and cooled, and what the paper states of it.

    `deflection_m` and `force_N` of shape (n,): steps 1, 2 and 3 one after the other.
    """

    deflection_m: Array
    force_N: Array
    xi_at_curve: float
    """ξ_X where Y meets the characteristic martensite curve."""
    curve_force_N: float
    full_force_N: float
    full_deflection_m: float
    """Deflection of Y at ξ_X = 0."""
    back_force_N: float
    back_deflection_m: float
    """Deflection of Y after X has cooled."""


def cycle_theory(parameters: ParameterSet) -> CycleTheory:
    """Steps 1 to 3 for these parameters (step 4 is step 1 with the springs exchanged)."""
    law = SpringLaw(parameters)
    force_curve = law.meets_curve()
    # Step 1, Eq. (32): Y loads along its linear line; F grows as ξ_X falls.
    xi_curve = _root(lambda xi: law.step1(xi) - force_curve, 0.0, 1.0)
    xi_1 = np.linspace(1.0, xi_curve, POINTS)
    force_1 = np.array([law.step1(xi) for xi in xi_1])
    delta_1 = law.delta0 + (force_1 - law.force0) / law.k_m
    # Step 2, Eq. (35): Y follows the characteristic curve.
    xi_2 = np.linspace(xi_curve, 0.0, POINTS)
    force_2 = np.array([law.step2(xi) for xi in xi_2])
    delta_2 = np.array([law.characteristic(force) for force in force_2])
    full_force, full_delta = float(force_2[-1]), float(delta_2[-1])
    # Step 3, Eq. (36): Y unloads along k_M from there while X turns to detwinned martensite.
    back_force = law.back(full_force, full_delta)
    force_3 = np.linspace(full_force, back_force, POINTS)
    delta_3 = full_delta + (force_3 - full_force) / law.k_m
    return CycleTheory(
        np.concatenate([delta_1, delta_2, delta_3]),
        np.concatenate([force_1, force_2, force_3]),
        xi_curve,
        force_curve,
        full_force,
        full_delta,
        float(force_3[-1]),
        float(delta_3[-1]),
    )


def stiffnesses(parameters: ParameterSet) -> tuple[float, float]:
    """k_M and k_A of a spring, N/m."""
    c1, c2 = spring_factors(parameters)
    k_m, k_a = (c2 * parameters[f"modulus_{phase}"] / c1 for phase in ("martensite", "austenite"))
    return k_m, k_a


def detwinned(force: F, start: float, finish: float) -> F:
    """g(b) of Eq. (12) at a force, of any shape; detwinning is from `start` to `finish`."""
    b = np.clip((force - start) / (finish - start), 0.0, 1.0)
    share: F = 0.5 * (1.0 - np.cos(np.pi * b))
    return share


class SpringLaw:
    """One spring's law in N and m: k(ξ) = k_A − (k_A − k_M) ξ, F = k (δ − δ_L ξ_S)."""

    def __init__(self, parameters: ParameterSet) -> None:
        c1, _ = spring_factors(parameters)
        self.k_m, self.k_a = stiffnesses(parameters)
        self.delta_l = parameters["max_deflection"]
        self.delta0 = parameters["initial_deflection"]
        self.force0 = parameters["initial_force"]
        self.xi_s0 = initial_detwinned(parameters)
        self.force_s = parameters["stress_start"] / c1
        self.force_f = parameters["stress_finish"] / c1

    def stiffness(self, xi: float) -> float:
        return self.k_a - (self.k_a - self.k_m) * xi

    def detwinned(self, force: F) -> F:
        """g(b) of Eq. (12)."""
        return detwinned(force, self.force_s, self.force_f)

    def characteristic(self, force: F) -> F:
        """Deflection on the characteristic martensite curve."""
        return force / self.k_m + self.delta_l * self.detwinned(force)

    def meets_curve(self) -> float:
        """Force at which the linear line through (δ0, F0) meets the characteristic curve."""
        b = float(np.arccos(1.0 - 2.0 * self.xi_s0)) / np.pi
        return self.force_s + b * (self.force_f - self.force_s)

    def step1(self, xi: float) -> float:
        """Eq. (32)."""
        alpha = self.k_m / self.stiffness(xi)
        free = self.k_m * (self.delta0 - self.delta_l * self.xi_s0 * xi)
        return (free + self.force0) / (1.0 + alpha)

    def step2(self, xi: float) -> float:
        """Eq. (35), with ξ_SY on the characteristic curve."""
        alpha = self.k_m / self.stiffness(xi)

        def miss(force: float) -> float:
            slack = self.delta_l * (self.xi_s0 * xi + self.detwinned(force))
            return self.k_m * (2.0 * self.delta0 - slack) / (1.0 + alpha) - force

        return _root(miss, 0.0, 10.0 * self.force_f)

    def back(self, full_force: float, full_delta: float) -> float:
        """Eq. (36) at the end of step 3: X at the temperature of the water.

        At M_S the stress has made as much detwinned martensite as Eq. (13) gives there; below it
        the rest turns to twinned martensite, which changes the stiffness only.
        """

        def free(xi_s: float) -> float:
            # X has the rest of the way: δ_X = 2δ0 − δ_Y.
            return self.k_m * (2.0 * self.delta0 - full_delta - self.delta_l * xi_s) + full_force

        def miss(force: float) -> float:
            xi_s = self.detwinned(force)
            return free(xi_s) / (1.0 + self.k_m / self.stiffness(xi_s)) - force

        at_start = _root(miss, 0.0, 10.0 * self.force_f)
        return free(self.detwinned(at_start)) / 2.0


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=1e-12))
