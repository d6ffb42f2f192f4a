"""From a parameter set to the arrays that the kernel takes, and the state that it starts from."""

from __future__ import annotations

import math
from functools import cache
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k
from sim_device.plant.errors import ModelError
from sim_device.plant.parameters import ParameterSet, initial_detwinned, spring_factors
from sim_device.plant.water import GRAVITY, at, film_table, real_water

Array = npt.NDArray[np.float64]
Variant = Literal["extended", "printed"]
Fixture = Literal["antagonistic", "stretch", "blocked"]
Cooling = Literal["water", "air"]

VARIANTS: tuple[str, ...] = get_args(Variant)
FIXTURES: tuple[str, ...] = get_args(Fixture)
COOLINGS: tuple[str, ...] = get_args(Cooling)


def check_options(variant: str, fixture: str, cooling: str) -> None:
    """Raise ModelError for a variant, fixture or cooling that the plant does not have."""
    for name, value, known in (
        ("variant", variant, VARIANTS),
        ("fixture", fixture, FIXTURES),
        ("cooling", cooling, COOLINGS),
    ):
        if value not in known:
            raise ModelError(f"{name} {value!r} is unknown; use one of {', '.join(known)}")


def kernel_constants(
    parameters: ParameterSet, *, variant: str, fixture: str, cooling: str
) -> Array:
    """The kernel's constants, shape (CONSTANTS_SIZE,), per the slots P_… of `kernel`."""
    check_options(variant, fixture, cooling)
    value = {entry.name: entry.value for entry in parameters.entries}
    wire, tube = value["wire_diameter"], value["tube_diameter"]
    c1, c2 = spring_factors(parameters)
    section = 0.25 * math.pi * wire * wire
    length = wire_length(parameters)
    mass = value["density"] * section
    annulus = 0.25 * math.pi * (tube * tube - wire * wire)
    heat_volume = water_heat_capacity()
    p = np.zeros(k.CONSTANTS_SIZE)
    p[k.P_C1] = c1
    p[k.P_K_M] = c2 * value["modulus_martensite"] / c1
    p[k.P_K_A] = c2 * value["modulus_austenite"] / c1
    p[k.P_DELTA_L] = value["max_deflection"]
    p[k.P_A_S] = value["austenite_start"]
    p[k.P_A_INV] = 1.0 / (value["austenite_finish"] - value["austenite_start"])
    p[k.P_C_A_INV] = 1.0 / value["slope_austenite"]
    p[k.P_M_S] = value["martensite_start"]
    p[k.P_M_INV] = 1.0 / (value["martensite_start"] - value["martensite_finish"])
    p[k.P_C_M] = value["slope_martensite"]
    p[k.P_TAU_S] = value["stress_start"]
    p[k.P_TAU_INV] = 1.0 / (value["stress_finish"] - value["stress_start"])
    p[k.P_MC_H] = mass * value["heat_capacity_heating"]
    p[k.P_MC_C] = mass * value["heat_capacity_cooling"]
    p[k.P_ML_H] = mass * value["latent_heating"]
    p[k.P_ML_C] = mass * value["latent_cooling"]
    p[k.P_OHM_M] = value["resistivity"] / section
    p[k.P_LENGTH] = length
    p[k.P_CW] = annulus * heat_volume
    p[k.P_SHARE] = value["warming_share"]
    p[k.P_UA] = value["tube_loss"]
    p[k.P_FLOW_G] = heat_volume / length
    p[k.P_FLOW_MAX] = value["flow_max"]
    p[k.P_AREA_INV] = 1.0 / annulus
    p[k.P_DH] = tube - wire
    p[k.P_SQRT_DH] = math.sqrt(tube - wire)
    p[k.P_PERIMETER] = math.pi * wire * value["film_scale"]
    p[k.P_AIR_K] = math.pi * value["air_conductivity"]
    p[k.P_AIR_C] = _air_factor(value, wire)
    gap = 2.0 * math.pi * value["air_conductivity"] / math.log(tube / wire)
    loss = value["tube_loss"]
    p[k.P_GAP] = gap * loss / (gap + loss)
    p[k.P_DRAIN_RATE] = 1.0 / value["drain_time"]
    p[k.P_FILM] = value["drain_film"]
    p[k.P_FILL_RATE] = 1.0 / (annulus * length)
    p[k.P_DELTA_0] = value["initial_deflection"]
    p[k.P_FIXTURE] = FIXTURES.index(fixture)
    p[k.P_WARMS] = 1.0 if variant == "extended" and cooling == "water" else 0.0
    p[k.P_WET] = 1.0 if cooling == "water" else 0.0
    p[k.P_WORK_SHARE] = value["work_share"]
    p[k.P_T_REF] = value["water_temperature"]
    p[k.P_TABLE_T0] = real_water().T_K[0]
    p[k.P_I_MAX] = value["current_max"]
    p[k.P_F0] = value["initial_force"]
    p[k.P_LENGTH_INV] = 1.0 / length
    p[k.P_DH_INV] = 1.0 / (tube - wire)
    return p


def apply_warming(p: Array, e: Array) -> None:
    """Effect water_warming: give the printed variant's water a node, with share φ = 1/κ."""
    if e[k.E_WARMING] > 0.0 and p[k.P_WET] > 0.0 and p[k.P_WARMS] == 0.0:
        p[k.P_WARMS] = 1.0
        p[k.P_SHARE] = 1.0 / e[k.E_WARMING]


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
    water = at(real_water(), 300.0)
    return float(water.rho[0] * water.cp[0])


def initial_state(
    parameters: ParameterSet, p: Array, e: Array, temperature_K: float | None = None
) -> Array:
    """The state at rest, shape (STATE_SIZE,): cold, all martensite, mounted as the fixture says.

    The antagonistic pair and the blocked spring start at (δ0, F0) with ξ_S0 of Eq. (10), a spring
    to be stretched starts without load. `temperature_K` is that of wire and water; by default the
    water's inlet temperature, or the ambient one without a cooling module.
    """
    s = np.zeros(k.STATE_SIZE)
    shared = s[k.SHARED :]
    shared[k.G_ENV_IN] = shared[k.G_T_IN] = parameters["water_temperature"]
    shared[k.G_ENV_AIR] = shared[k.G_T_AIR] = parameters["ambient_temperature"]
    start = float(shared[k.G_T_IN] if p[k.P_WET] > 0.0 else shared[k.G_T_AIR])
    if temperature_K is not None:
        start = temperature_K
    fixture = FIXTURES[int(p[k.P_FIXTURE])]
    mounted = {"antagonistic": (True, True), "stretch": (False, False), "blocked": (True, False)}
    for first, loaded in zip((0, k.S_SIZE), mounted[fixture], strict=True):
        spring = s[first : first + k.S_SIZE]
        force = parameters["initial_force"] if loaded else 0.0
        detwinned = initial_detwinned(parameters) if loaded else 0.0
        spring[k.S_T] = start
        spring[k.S_TW] = start
        spring[k.S_T_WALL] = start
        spring[k.S_XS] = detwinned
        spring[k.S_XS_END] = detwinned
        spring[k.S_XT] = 1.0 - detwinned
        spring[k.S_FILL] = p[k.P_WET]
        spring[k.S_WETTED] = 1.0
        spring[k.S_F] = force
        spring[k.S_DELTA] = parameters["initial_deflection"] if loaded else 0.0
        spring[k.S_OHM] = p[k.P_OHM_M] * p[k.P_LENGTH]
        spring[k.S_ELASTIC] = 0.5 * force * force * k.compliance(1.0, p, e)
        tau = p[k.P_C1] * force
        spring[k.S_TAU] = tau
        spring[k.S_A] = k.progress_a(start, tau, p, e[k.E_SPREAD] * p[k.P_A_INV])
        spring[k.S_B] = k.progress_b(start, tau, p)
        spring[k.S_C] = k.progress_c(start, p)
        if e[k.E_UNIFIED] > 0.0:
            hot, cold = k.starts(tau, p)
            spring[k.S_A] = k.heating_progress(start, hot, p)
            spring[k.S_C] = k.cooling_progress(start, cold, p)
            spring[k.S_LEG] = spring[k.S_XI_LEG] = 1.0
            spring[k.S_HOT : k.S_DELTA : 2] = k.PROGRESS_HIGH
        for cell in range(k.CELLS):
            at = k.S_CELLS + cell * k.S_KINETICS
            spring[at : at + k.S_KINETICS] = spring[k.S_XS : k.S_XS + k.S_KINETICS]
        if e[k.E_R_WIDTH] > 0.0:
            above = p[k.P_M_S] + e[k.E_R_ABOVE] - start
            spring[k.S_R_PROGRESS] = k.clip01(above / e[k.E_R_WIDTH])
    shared[k.G_F] = s[k.S_F]
    return s


def table_of(variant: str) -> Array:
    """The film table of that variant, for the kernel."""
    return film_table(variant)
