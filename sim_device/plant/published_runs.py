"""Other laboratories' experiments on the plant: their geometry, current, room and alloy.

All else is the set "conserving".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from typing import TypedDict

from sim_device.plant.geometry import Geometry, air_film, heating_K_per_s, scaled
from sim_device.plant.parameters import ParameterSet, load_parameters
from sim_device.plant.plant import Plant
from sim_device.plant.records import Drive
from sim_device.plant.units import ZERO_C

_RESISTIVITY_OF_D = (0.80e-6, 1.00e-6)
"""Of martensite and of austenite, Ω m: a wire is between them."""
_ROOM_K_OF_K = ZERO_C + 18.0  # tinf of springProperties.py
_ROOM_C_OF_D = 25.0
SPECIFIC_HEAT_OF_D = 837.0  # J/(kg K)
LATENT_HEAT_OF_D = 24_200.0  # J/kg
_ALLOYS = {
    "K": (69.0, 83.0, 60.0, 43.0),
    "70 °C": (68.0, 78.0, 52.0, 42.0),
    "90 °C": (88.0, 98.0, 72.0, 62.0),
}
"""A_S, A_F, M_S, M_F without stress, °C."""
_SPRINGS_OF_L = {
    0.5: (0.79, 4.3, 20.0, 4.0),
    1.0: (0.41, 1.1, 40.0, 16.0),
    2.0: (0.17, 0.27, 50.0, 60.0),
}
"""Wire, mm: ohms of the spring, ohms a metre of the wire, largest stroke, mm, current, A."""
_LONG_MM_OF_L = 50.0
FAN_M_PER_S_OF_L = 0.363
"""Not stated; at this speed its 1 mm spring relaxes in the 11.5 s that it states."""
_LONGEST_S = 300.0
_HOT = 1e-3  # martensite left of what is called hot
_HEATED, _COOLED = 0.05, 0.875  # martensite: contracted; all but the last 0.5 % of 4 % strain back


def _base(heats_of_d: bool) -> ParameterSet:
    base = load_parameters("conserving")
    if not heats_of_d:
        return base
    return base.replace(
        heat_capacity_heating=SPECIFIC_HEAT_OF_D,
        heat_capacity_cooling=SPECIFIC_HEAT_OF_D,
        latent_heating=LATENT_HEAT_OF_D,
        latent_cooling=LATENT_HEAT_OF_D,
    )


def _with_alloy(base: ParameterSet, alloy: str, room_K: float) -> ParameterSet:
    a_s, a_f, m_s, m_f = (ZERO_C + degC for degC in _ALLOYS[alloy])
    return base.replace(
        austenite_start=a_s,
        austenite_finish=a_f,
        martensite_start=m_s,
        martensite_finish=m_f,
        ambient_temperature=room_K,
        water_temperature=room_K,
    )


@cache
def heated_in_air(
    current_A: float, pitch_mm: float, heats_of_d: bool = False
) -> tuple[float, float]:
    """Final rise of K's spring in still air, K, and its time constant ∫(1 − rise/final) dt, s."""
    geometry = Geometry(wire_mm=0.51, coil_mm=3.45, turns=8, pitch_mm=pitch_mm)
    parameters = _with_alloy(scaled(_base(heats_of_d), geometry), "K", _ROOM_K_OF_K)
    plant = Plant(parameters, cooling="air", fixture="stretch", **air_film(parameters, geometry))
    drive, step_s, rises = Drive((current_A, 0.0)), 0.1, []
    for _ in range(3000):
        plant.advance(drive, step_s)
        rises.append(plant.T_K[0] - _ROOM_K_OF_K)
    return rises[-1], step_s * sum(1.0 - rise / rises[-1] for rise in rises)


@cache
def relaxing(
    geometry: Geometry,
    current_A: float,
    alloy: str,
    *,
    heats_of_d: bool = False,
    around: str = "air",
) -> tuple[float, float]:
    """How long an unloaded spring takes to contract, and then to relax without current, s.

    In still "air", in that of L's "fan", or in a "bath" as warm as the room. Infinite where the
    current does not heat it through.
    """
    room_K = ZERO_C + _ROOM_C_OF_D
    parameters = _with_alloy(scaled(_base(heats_of_d), geometry), alloy, room_K)
    if around == "bath":
        plant = Plant(parameters, cooling="bath", fixture="stretch")
    else:
        air_m_per_s = FAN_M_PER_S_OF_L if around == "fan" else 0.0
        film = air_film(parameters, geometry, air_m_per_s=air_m_per_s)
        plant = Plant(parameters, cooling="air", fixture="stretch", **film)
    step_s = 0.025 * geometry.wire_mm
    rise_K_per_s = heating_K_per_s(parameters, current_A)
    phases: list[tuple[Drive, float, Callable[[float], bool]]] = [
        (Drive((current_A, 0.0)), min(step_s, 0.5 / rise_K_per_s), lambda xi: xi <= _HEATED),
        (Drive(), step_s, lambda xi: xi >= _COOLED),
    ]
    times_s = []
    for drive, dt_s, done in phases:
        taken_s = 0.0
        while not done(plant.xi[0]):
            if taken_s > _LONGEST_S:
                return math.inf, math.inf
            plant.advance(drive, dt_s)
            taken_s += dt_s
        times_s.append(taken_s)
    return times_s[0], times_s[1]


def wire(wire_mm: float) -> Geometry:
    """A straight wire: its coil and turns decide lengths only, which cancel."""
    return Geometry(wire_mm=wire_mm, coil_mm=10.0 * wire_mm, turns=20)


def spring_of_l(wire_mm: float) -> Geometry:
    """A spring of L: ten wires outside, 50 mm long, turns by its resistance a metre of its wire."""
    coil_mm = 9.0 * wire_mm
    spring_Ohm, wire_Ohm_per_m, _, _ = _SPRINGS_OF_L[wire_mm]
    turns = 1e3 * spring_Ohm / wire_Ohm_per_m / (math.pi * coil_mm)
    return Geometry(
        wire_mm=wire_mm, coil_mm=coil_mm, turns=turns, pitch_mm=_LONG_MM_OF_L / turns - wire_mm
    )


def force_of_l(wire_mm: float) -> Callable[[], float]:
    """Force of the hot spring, stretched from its free length by the largest stroke stated, N."""

    def force_N() -> float:
        *_, stroke_mm, current_A = _SPRINGS_OF_L[wire_mm]
        parameters = scaled(_base(False), spring_of_l(wire_mm))
        plant = Plant(
            _with_alloy(parameters, "90 °C", ZERO_C + _ROOM_C_OF_D),
            cooling="air",
            fixture="stretch",
        )
        drive = Drive((current_A, 0.0), stage_m=1e-3 * stroke_mm)
        while plant.xi[0] > _HOT:
            plant.advance(drive, 0.02)
        return plant.truth.spring_force_N[0]

    return force_N


class Timed(TypedDict):
    """A time with our heats, and with those that D states."""

    ours: Callable[[], float]
    with_heats: Callable[[], float]


def timed(
    geometry: Geometry, current_A: float, alloy: str, phase: str, *, around: str = "air"
) -> Timed:
    """How long a spring or wire takes to "contract" or to "relax", by `relaxing`."""
    index = ("contract", "relax").index(phase)

    def time_s(heats_of_d: bool) -> float:
        times_s = relaxing(geometry, current_A, alloy, heats_of_d=heats_of_d, around=around)
        return times_s[index]

    return Timed(ours=partial(time_s, False), with_heats=partial(time_s, True))


def relaxing_of_l(wire_mm: float, around: str) -> Timed:
    """How long a spring of L takes to relax: in air, or in water after a tenfold current."""
    more = 10.0 if around == "bath" else 1.0
    return timed(
        spring_of_l(wire_mm), more * _SPRINGS_OF_L[wire_mm][3], "90 °C", "relax", around=around
    )


def resistance_per_m(wire_mm: float) -> float:
    """Ohm a metre of wire."""
    return load_parameters("conserving")["resistivity"] / _section_m2(wire_mm)


def _section_m2(wire_mm: float) -> float:
    return 0.25e-6 * math.pi * wire_mm**2


def stated_per_m(wire_mm: float) -> tuple[float, float]:
    martensite, austenite = (rho / _section_m2(wire_mm) for rho in _RESISTIVITY_OF_D)
    return martensite, austenite
