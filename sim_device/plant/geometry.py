"""A spring of one's own: wire, coil, turns, pitch and tube in one file, scaled from a known set.

A parameter set is that of one spring. For another one of the same alloy, what geometry decides is
scaled, and all else stays:

- lengths at a given shear strain (δ_L, δ0) with 1/C2, Eq. (2): π N D²/d;
- the mounted tension F0, at a given shear stress, with 1/C1, Eq. (3). ξ_S0 of Eq. (10) is kept;
- wire, coil, turns and tube are taken as they are: mass, resistance, films follow from them.

Not scaled: the alloy (moduli, stresses, temperatures, heats, resistivity), the pump's flow, the
loss of the tube per metre.

A coil in still air loses less heat where its turns are close, and any wire radiates: `air_film`.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TypedDict

from sim_device.plant.constants import wire_length
from sim_device.plant.errors import ParameterError
from sim_device.plant.laws import Factor, Law, Term, joined
from sim_device.plant.parameters import (
    ParameterSet,
    initial_detwinned,
    load_parameters,
    spring_factors,
)
from sim_device.plant.textfile import TextFileError, beside, parsed

PITCH_FACTOR = (0.587, 0.086, 0.0142)
"""Factor on the air film of a straight wire, of a coil COIL_K warmer than the air: of turns that
touch, and what it gains with the wire diameters between them and with their square."""
COIL_EXPONENT, COIL_K = 0.181, 50.0
"""Of the temperature difference in that factor: a coil's film grows faster than a wire's."""
PITCH_MOST = 6.0
"""So many wire diameters apart was it measured."""
EMISSIVITY = 0.55
"""Of oxidised titanium, 8-14 um: 0.5 to 0.6 (Raytek, emissivity table for metals); NiTi is covered
by oxide of titanium."""
STEFAN_BOLTZMANN = 5.670374e-8  # W/(m2 K4)
_HOTTEST_RISE_K = 600.0
SLOWEST_FAN_M_PER_S = 0.2
"""Below, the wire's own draught counts."""
_LIMITS_MM = {
    "wire": (0.01, 5.0),
    "coil": (0.05, 50.0),
    "pitch": (0.0, 50.0),
    "tube": (0.02, 20.0),
}
_TURNS = (1.0, 200.0)
_PRESTRAIN = (1e-4, 0.2)


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """A spring: diameters in mm, coil is the mean one; turns; `pitch_mm` between the turns.

    tube_mm: inner diameter of the tube, None for the base's gap around the wire. pitch_mm: from one
    turn to the next less the touching distance, 0 for turns that touch; None for a straight wire's
    film. prestrain: shear strain of the mounted spring, None for that of the base.
    """

    wire_mm: float
    coil_mm: float
    turns: float
    pitch_mm: float | None = None
    tube_mm: float | None = None
    prestrain: float | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in _LIMITS_MM.items():
            value = getattr(self, f"{name}_mm")
            if value is not None:
                _within(f"{name}_mm", value, low, high)
        _within("turns", self.turns, *_TURNS)
        if self.prestrain is not None:
            _within("prestrain", self.prestrain, *_PRESTRAIN)
        if self.coil_mm < 2.0 * self.wire_mm:
            raise ParameterError(
                "coil_mm",
                f"{self.coil_mm:g} mm is less than two wires of {self.wire_mm:g} mm;"
                " wind a wider coil, or take thinner wire",
            )
        if self.tube_mm is not None and self.tube_mm <= self.wire_mm:
            raise ParameterError(
                "tube_mm",
                f"{self.tube_mm:g} mm does not hold the wire of {self.wire_mm:g} mm;"
                " take a wider tube",
            )


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ParameterError(name, f"{value:g} is outside {low:g} to {high:g}; give one within")


def load_geometry(
    path: str | Path | None, *, base: str | None = None
) -> tuple[ParameterSet, Geometry]:
    """The base set and the geometry of a file; None: that of the base set itself.

    Keys: `base` (a built-in set or a parameter file beside it, default A; the argument replaces
    it), and those of Geometry.
    Raises ParameterError for anything missing, unknown or out of range.
    """
    if path is None:
        parameters = load_parameters(base or "A")
        wire_mm, coil_mm = 1e3 * parameters["wire_diameter"], 1e3 * parameters["coil_diameter"]
        return parameters, Geometry(wire_mm=wire_mm, coil_mm=coil_mm, turns=parameters["coils"])
    path = Path(path)
    try:
        raw = parsed(path, "TOML", tomllib.loads)
    except TextFileError as error:
        raise ParameterError("file", f"{path} {error}; give a file of a geometry") from None
    named = str(raw.pop("base", "A"))
    names = {field.name: field for field in fields(Geometry)}
    for key, value in raw.items():
        if key not in names:
            raise ParameterError(key, f"unknown in {path.name}; known are base, {', '.join(names)}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(key, f"is {value!r}, not a number; write {key} = 1.5")
    missing = [name for name in ("wire_mm", "coil_mm", "turns") if name not in raw]
    if missing:
        raise ParameterError(missing[0], f"missing in {path.name}; add {missing[0]} = …")
    return load_parameters(base or beside(path, named) or named), Geometry(**raw)


def scaled(base: ParameterSet, geometry: Geometry) -> ParameterSet:
    """The parameter set of another spring of the same alloy. Raises ParameterError."""
    wire, coil = geometry.wire_mm * 1e-3, geometry.coil_mm * 1e-3
    gap = base["tube_diameter"] - base["wire_diameter"]
    tube = wire + gap if geometry.tube_mm is None else geometry.tube_mm * 1e-3
    size = {"wire_diameter": wire, "coil_diameter": coil, "coils": float(geometry.turns)}
    c1, c2 = spring_factors(base)
    # Between the two replacements δ0 and F0 need not fit: all of it goes in at once.
    new_c1, new_c2 = spring_factors(_Sized(size))  # type: ignore[arg-type]
    stretch, pull = c2 / new_c2, c1 / new_c1
    strain = c2 * base["initial_deflection"]
    more = 1.0 if geometry.prestrain is None else geometry.prestrain / strain
    deflection = base["initial_deflection"] * stretch * more
    force = base["initial_force"] * pull
    if geometry.prestrain is not None:
        force = _force_at(base, geometry.prestrain) / new_c1
    return base.replace(
        **size,
        tube_diameter=tube,
        max_deflection=base["max_deflection"] * stretch,
        initial_deflection=deflection,
        initial_force=force,
    )


class _Sized(dict[str, float]):
    """As much of a parameter set as `spring_factors` reads."""


def _force_at(base: ParameterSet, strain: float) -> float:
    """Shear stress of martensite at a strain on loading, Eqs (9), (12): Pa.

    Of martensite is detwinned what the mounted base has, ξ_S0, or what the stress detwins if that
    is more. Bisection of τ = G_M (γ - γ_L ξ_S(τ)), whose right side falls with τ.
    """
    modulus, span = base["modulus_martensite"], base["stress_finish"] - base["stress_start"]
    most = spring_factors(base)[1] * base["max_deflection"]
    low, high = 0.0, modulus * strain
    for _ in range(100):
        tau = 0.5 * (low + high)
        b = min(max((tau - base["stress_start"]) / span, 0.0), 1.0)
        detwinned = max(0.5 * (1.0 - math.cos(math.pi * b)), initial_detwinned(base))
        if tau > modulus * (strain - most * detwinned):
            high = tau
        else:
            low = tau
    return 0.5 * (low + high)


def section_m2(parameters: ParameterSet) -> float:
    """Cross-section of the wire."""
    return 0.25 * math.pi * parameters["wire_diameter"] ** 2


def heating_K_per_s(parameters: ParameterSet, current_A: float) -> float:
    """Rise of a wire that loses no heat: β_s (I/A_c)² / (ρ_s C_h)."""
    density_A_per_m2 = current_A / section_m2(parameters)
    capacity = parameters["density"] * parameters["heat_capacity_heating"]
    return parameters["resistivity"] * density_A_per_m2**2 / capacity


class AirFilm(TypedDict):
    """What makes the loss of a straight wire to still air that of a spring, for a Plant."""

    laws: tuple[Law, ...]
    effects: dict[str, dict[str, float]]


def pitch_factor(pitch_mm: float, wire_mm: float) -> float:
    """Factor on the film of a straight wire in still air, for a coil of that pitch at COIL_K.

    Fitted, with COIL_EXPONENT, to what Kolyvas et al. measured on a spring of 0.51 mm wire and
    3.45 mm coil, turns touching to 3 mm apart, 0.3 to 1.05 A (doi 10.1177/1045389X18770880, the
    surface in springProperties.py of their repository): with `radiating_share` beside it within
    2 % rms, 8 % at worst. Beyond PITCH_MOST it stays.
    """
    apart = min(pitch_mm / wire_mm, PITCH_MOST)
    closed, linear, square = PITCH_FACTOR
    return closed + linear * apart + square * apart * apart


def radiating_share(geometry: Geometry) -> float:
    """What the wire radiates over what a black one does that sees the room only.

    1/((1 - ε)/ε + 1/F), with F the share of the wire's radiation that reaches the room: 1 for a
    straight one. Of a coil half goes outwards and half inwards, and passes as through a row of
    cylinders (Incropera, Table 13.1), the inner half once more. Turns are as warm as each other.
    """
    view = 1.0
    if geometry.pitch_mm is not None:
        apart = max(geometry.pitch_mm / geometry.wire_mm, 1e-9) + 1.0  # centre to centre, in wires
        row = 1.0 - math.sqrt(1.0 - apart**-2) + math.atan(math.sqrt(apart**2 - 1.0)) / apart
        view = apart / math.pi * row * (2.0 - row)
    return 1.0 / ((1.0 - EMISSIVITY) / EMISSIVITY + 1.0 / view)


def radiation(parameters: ParameterSet, geometry: Geometry) -> Law:
    """The heat that the wire radiates to a room as warm as the air, as a law.

    σ (T⁴ - T_a⁴) by two terms, that are exact 50 and 100 K above the air and within 6 % between.
    """
    room_K = parameters["ambient_temperature"]
    area_m2 = math.pi * parameters["wire_diameter"] * wire_length(parameters)
    near, far = (
        STEFAN_BOLTZMANN * ((room_K + rise_K) ** 4 - room_K**4) / rise_K for rise_K in (50.0, 100.0)
    )
    lost = area_m2 * radiating_share(geometry)
    rise = _rise(parameters)
    terms = (
        Term(name="rise", factors=(rise,), coefficient=-lost * (2.0 * near - far)),
        Term(name="square", factors=(rise, rise), coefficient=-lost * (far - near) / 50.0),
    )
    return Law("heat_into_wire", "both", terms)


def fan(parameters: ParameterSet, air_m_per_s: float) -> tuple[Law, Law]:
    """The loss of a wire in cross-flow, and what takes that to still air away, as laws.

    Churchill and Bernstein 1977 (Incropera, Eq. 7.54) with the set's values of air.
    """
    viscosity = parameters["air_viscosity"]
    prandtl = viscosity / parameters["air_diffusivity"]
    reynolds = air_m_per_s * parameters["wire_diameter"] / viscosity
    nusselt = 0.3 + 0.62 * math.sqrt(reynolds) * prandtl ** (1.0 / 3.0) / (
        1.0 + (0.4 / prandtl) ** (2.0 / 3.0)
    ) ** 0.25 * (1.0 + (reynolds / 282_000.0) ** (5.0 / 8.0)) ** (4.0 / 5.0)
    lost_W_per_K = math.pi * parameters["air_conductivity"] * nusselt * wire_length(parameters)
    blown = Term(name="fan", factors=(_rise(parameters),), coefficient=-lost_W_per_K)
    still = Term(name="still", coefficient=-1.0)
    return Law("heat_into_wire", "both", (blown,)), Law("film", "both", (still,))


def _rise(parameters: ParameterSet) -> Factor:
    """How much warmer than the air the wire is, K."""
    room_K = parameters["ambient_temperature"]
    return Factor(state="wire", low=room_K, high=room_K + _HOTTEST_RISE_K, centre=room_K, scale=1.0)


def air_film(parameters: ParameterSet, geometry: Geometry, *, air_m_per_s: float = 0.0) -> AirFilm:
    """What a spring loses to air, for a Plant with cooling="air".

    Radiation, and in still air the film of a coil (`pitch_mm` given), in that of a fan (from
    SLOWEST_FAN_M_PER_S on) the film of a wire in cross-flow.
    """
    radiates = radiation(parameters, geometry)
    if air_m_per_s:
        blown, still = fan(parameters, air_m_per_s)
        return AirFilm(laws=joined((blown, radiates, still)), effects={})
    if geometry.pitch_mm is None:
        return AirFilm(laws=(radiates,), effects={})
    factor = pitch_factor(geometry.pitch_mm, geometry.wire_mm)
    pitch = Law("film", "both", (Term(name="pitch", coefficient=factor - 1.0),))
    exponent = {"exponent": COIL_EXPONENT, "reference_K": COIL_K}
    return AirFilm(laws=(pitch, radiates), effects={"convection_exponent": exponent})
