"""Heating at 4 A once more, by hand: physics.md's equations with bisection and an Euler step.

Nothing of the plant's solver is used, only the parameter set and the table of water. While X heats
for the first time ξ = f(a), Eq. (11), and Y, cold, lies on its martensite curve, Eq. (12).
"""

import math

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.parameters import initial_detwinned, spring_factors
from sim_device.plant.water import interpolated, real_water
from tests.sim_device.plant.test_facts import time_to

STEP_S = 0.02


def left(progress):
    return 0.5 * (math.cos(math.pi * min(max(progress, 0.0), 1.0)) + 1.0)


def bisect(excess, low, high, times=36):
    """Where the rising `excess` passes zero."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def fraction_of_x(p, T):
    """ξ of X at temperature T, with the tension that the pair then has."""
    c1, c2 = spring_factors(p)
    k_m, k_a = (c2 * p[f"modulus_{phase}"] / c1 for phase in ("martensite", "austenite"))
    first = initial_detwinned(p)

    def xi(F):
        span = p["austenite_finish"] - p["austenite_start"]
        return left((T - p["austenite_start"] - c1 * F / p["slope_austenite"]) / span)

    def too_long(F):
        x = xi(F)
        spread = p["stress_finish"] - p["stress_start"]
        y = max(first, 1.0 - left((c1 * F - p["stress_start"]) / spread))
        of_x = F / (x * k_m + (1 - x) * k_a) + p["max_deflection"] * first * x
        return of_x + F / k_m + p["max_deflection"] * y - 2 * p["initial_deflection"]

    return xi(bisect(too_long, 0.0, 5.0))


def film(p, T, T_water):
    """Eqs (19)-(21) in still water, per metre of wire."""
    water = interpolated(real_water(), 0.5 * (T + T_water))
    rho, cp, k, mu, beta = (
        float(column[0]) for column in (water.rho, water.cp, water.k, water.mu, water.beta)
    )
    gap = p["tube_diameter"] - p["wire_diameter"]
    pr = mu * cp / k
    ra = 9.81 * beta * abs(T - T_water) * gap**3 * rho**2 / mu**2 * pr
    nu = (0.60 + 0.387 * (ra / (1 + (0.559 / pr) ** (9 / 16)) ** (16 / 9)) ** (1 / 6)) ** 2
    return k * nu / gap * math.pi * p["wire_diameter"]


def seconds_to_322_K(p, amps):
    section = math.pi / 4 * p["wire_diameter"] ** 2
    mass = p["density"] * section
    cold = interpolated(real_water(), 300.0)
    annulus = math.pi / 4 * (p["tube_diameter"] ** 2 - p["wire_diameter"] ** 2)
    stored = p["warming_share"] * annulus * float(cold.rho[0] * cold.cp[0])
    T, T_water, x, steps = 300.0, 300.0, 1.0, 0
    while T < 322.0:
        passed = film(p, T, T_water) * (T - T_water)
        heat = (p["resistivity"] * amps**2 / section - passed) * STEP_S

        def surplus(end, T=T, x=x, heat=heat):
            latent = mass * p["latent_heating"] * (x - fraction_of_x(p, end))
            return mass * p["heat_capacity_heating"] * (end - T) + latent - heat

        T_water += STEP_S * (passed - p["tube_loss"] * (T_water - 300.0)) / stored
        T = bisect(surplus, T - 1.0, T + 1.0, times=24)
        x = fraction_of_x(p, T)
        steps += 1
    return steps * STEP_S


@pytest.mark.parametrize("name", ["A", "B"])
def test_the_plant_heats_as_the_equations_by_hand_do(name):
    parameters = load_parameters(name)
    by_hand = seconds_to_322_K(parameters, 4.0)
    assert time_to(parameters, 4.0, 322.0) == pytest.approx(by_hand, rel=5e-3)
