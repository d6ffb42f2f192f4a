"""From a parameter set to the numbers that the kernel takes, and how a plant is mounted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Literal, get_args

from sim_device.plant.errors import ModelError
from sim_device.plant.kernel.model import ANTAGONISTIC, BLOCKED, STRETCH
from sim_device.plant.parameters import ParameterSet, initial_detwinned, spring_factors
from sim_device.plant.start import AS_MOUNTED, Start
from sim_device.plant.water import GRAVITY, interpolated, real_water

Variant = Literal["extended", "printed"]
Fixture = Literal["antagonistic", "stretch", "blocked"]
Cooling = Literal["water", "air", "bath"]

VARIANTS: tuple[str, ...] = get_args(Variant)
FIXTURES: tuple[str, ...] = get_args(Fixture)
COOLINGS: tuple[str, ...] = get_args(Cooling)
_FIXTURES = {"antagonistic": ANTAGONISTIC, "stretch": STRETCH, "blocked": BLOCKED}


def check_options(variant: str, fixture: str, cooling: str) -> None:
    """Raise ModelError for a variant, fixture or cooling that the plant does not have."""
    for name, value, choices in (
        ("variant", variant, VARIANTS),
        ("fixture", fixture, FIXTURES),
        ("cooling", cooling, COOLINGS),
    ):
        if value not in choices:
            raise ModelError(f"{name} {value!r} is unknown; use one of {', '.join(choices)}")


def kernel_constants(
    parameters: ParameterSet, *, variant: str, fixture: str, cooling: str
) -> dict[str, float]:
    """The kernel's `Constants`, by name.

    In a bath the water stays as warm as at the inlet and rests: the film is Eq. (20) with the
    wire's diameter.
    """
    check_options(variant, fixture, cooling)
    value = {entry.name: entry.value for entry in parameters.entries}
    wire, tube = value["wire_diameter"], value["tube_diameter"]
    c1, c2 = spring_factors(parameters)
    section = 0.25 * math.pi * wire * wire
    length = wire_length(parameters)
    mass = value["density"] * section
    bath = cooling == "bath"
    film_diameter = wire if bath else tube - wire
    annulus = 0.25 * math.pi * (tube * tube - wire * wire)
    heat_volume = water_heat_capacity()
    gap = 2.0 * math.pi * value["air_conductivity"] / math.log(tube / wire)
    loss = value["tube_loss"]
    return {
        "C1": c1,
        "k_M": c2 * value["modulus_martensite"] / c1,
        "k_A": c2 * value["modulus_austenite"] / c1,
        "delta_L": value["max_deflection"],
        "A_S": value["austenite_start"],
        "per_A_range": 1.0 / (value["austenite_finish"] - value["austenite_start"]),
        "per_C_A": 1.0 / value["slope_austenite"],
        "M_S": value["martensite_start"],
        "per_M_range": 1.0 / (value["martensite_start"] - value["martensite_finish"]),
        "C_M": value["slope_martensite"],
        "tau_start": value["stress_start"],
        "per_tau_range": 1.0 / (value["stress_finish"] - value["stress_start"]),
        "capacity_heating": mass * value["heat_capacity_heating"],
        "capacity_cooling": mass * value["heat_capacity_cooling"],
        "latent_heating": mass * value["latent_heating"],
        "latent_cooling": mass * value["latent_cooling"],
        "resistance_per_m": value["resistivity"] / section,
        "length": length,
        "water_capacity": annulus * heat_volume,
        "warming_share": value["warming_share"],
        "tube_loss": value["tube_loss"],
        "flow_conductance": heat_volume / length,
        "flow_max": value["flow_max"],
        "per_annulus": 0.0 if bath else 1.0 / annulus,
        "D_h": film_diameter,
        "sqrt_D_h": math.sqrt(film_diameter),
        "film_perimeter": math.pi * wire * value["film_scale"],
        "air_conductance": math.pi * value["air_conductivity"],
        "air_convection": _air_factor(value, wire),
        "gap_conductance": gap * loss / (gap + loss),
        "drain_rate": 1.0 / value["drain_time"],
        "drain_film": value["drain_film"],
        "fill_rate": 1.0 / (annulus * length),
        "delta_0": value["initial_deflection"],
        "fixture": _FIXTURES[fixture],
        "warms": 1.0 if variant == "extended" and cooling == "water" else 0.0,
        "wet": 0.0 if cooling == "air" else 1.0,
        "work_share": value["work_share"],
        "T_ref": value["water_temperature"],
        "table_T0": float(real_water().T_K[0]),
        "I_max": value["current_max"],
        "F0": value["initial_force"],
        "per_length": 1.0 / length,
        "per_D_h": 1.0 / film_diameter,
    }


def apply_warming(constants: dict[str, float], terms: Mapping[str, float]) -> None:
    """Effect water_warming: give the printed variant's water a node, with share φ = 1/κ."""
    inverse = terms["inverse_warming_share"]
    if inverse > 0.0 and constants["wet"] > 0.0 and constants["warms"] == 0.0:
        constants["warms"] = 1.0
        constants["warming_share"] = 1.0 / inverse


def _air_factor(value: dict[str, float], wire: float) -> float:
    prandtl = value["air_viscosity"] / value["air_diffusivity"]
    rayleigh = (
        GRAVITY
        * value["air_expansion"]
        * wire**3
        / (value["air_viscosity"] * value["air_diffusivity"])
    )
    shape = (1.0 + (0.559 / prandtl) ** (9.0 / 16.0)) ** (16.0 / 9.0)
    return float(0.387 * (rayleigh / shape) ** (1.0 / 6.0))


def wire_length(parameters: ParameterSet) -> float:
    """Length of one spring's wire, m: π D_s N."""
    return math.pi * parameters["coil_diameter"] * parameters["coils"]


@cache
def water_heat_capacity() -> float:
    """ρ C_w of real water at 300 K, J/(m³ K).

    Also for the printed variant, which needs it only with effect water_warming: its polynomials
    would give 66 % more.
    """
    water = interpolated(real_water(), 300.0)
    return float(water.rho[0] * water.cp[0])


def mounting(
    parameters: ParameterSet,
    *,
    fixture: str,
    cooling: str,
    temperature_K: float | None = None,
    start: Start = AS_MOUNTED,
) -> dict[str, float]:
    """The kernel's `Mounting`, by name: all martensite, mounted as the fixture says.

    The antagonistic pair and the blocked spring start at (δ0, F0) with ξ_S0 of Eq. (10), a spring
    to be stretched starts without load. `temperature_K` is that of wire and water; by default the
    water's inlet temperature, or the ambient one in air. Give none far above A_S + τ/C_A: such a
    start stays martensite until it has been cold once. A pair with another `start` is detwinned by
    Eq. (10) as its tension says, one spring more by the displacement, the other less.
    """
    inlet, air = parameters["water_temperature"], parameters["ambient_temperature"]
    if temperature_K is None:
        temperature_K = air if cooling == "air" else inlet
    x_K, y_K = start.wires_K or (temperature_K, temperature_K)
    return {
        "T_x": x_K,
        "T_y": y_K,
        "T_inlet": inlet,
        "T_air": air,
        "tension": parameters["initial_force"] if start.tension_N is None else start.tension_N,
        "xi_S": initial_detwinned(parameters, start.tension_N),
        "deflection": parameters["initial_deflection"],
        "displacement": start.displacement_m,
        "loads_x": float(fixture != "stretch"),
        "loads_y": float(fixture == "antagonistic"),
    }
