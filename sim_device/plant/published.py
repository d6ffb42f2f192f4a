"""Numbers that other laboratories measured, beside what the plant gives for their geometry.

Of a source are taken: geometry, currents, room temperature, the transformation temperatures of its
alloy. All else is the set "conserving". `python -m sim_device.plant.docs` writes the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from sim_device.plant.geometry import Geometry, heating_K_per_s, pitch_law, scaled
from sim_device.plant.parameters import ParameterSet, load_parameters
from sim_device.plant.plant import Plant
from sim_device.plant.records import Drive

SOURCES = {
    "K": "Kolyvas et al., J. Intell. Mater. Syst. Struct. 2018, doi 10.1177/1045389X18770880: "
    "`springProperties.py` and `operatorParameters.m` of efthymiosKolyvas/modelBasedDesignSMAs "
    "(0.51 mm wire, 3.45 mm coil, 8 turns)",
    "D": "Dynalloy, Technical characteristics of Flexinol actuator wires, F1140 (all values "
    "approximate); transformation temperatures from Model_Parameters.m of "
    "NicholasBaraghini/Modeling-and-Simulation-of-Mechatronic-Systems",
    "T": "Tadesse, Thayer, Priya, J. Intell. Mater. Syst. Struct. 2010, doi "
    "10.1177/1045389X09352814, abstract",
    "N": "Nizamani, Daudpoto, Nizamani, Development of faster SMA actuators, 2017, doi "
    "10.5772/intechopen.69868, abstract (0.15 mm wire)",
    "C": "copper-cored spring, Adv. Mech. Eng. 2021, doi 10.1177/16878140211044651, abstract",
    "M": "the sheet of D, Rev. M of 2025, as cited in public repositories",
    "L": "Delta Robotics, `hardware/nitinol/spring.md`, `wire.md` and `tf-mk.1-muscle.md` of "
    "Delta-Robotics-Inc/Delta-Public; ranges are its estimates",
    "H": "Shaw, Churchill, Iadicola, Exp. Techniques 2008, part 1, abstract: DSC of two wires",
}
NEAR = 0.2
"""So close counts as near, where a source states no interval."""
_RESISTIVITY_OF_D = (0.80e-6, 1.00e-6)
"""Of martensite and of austenite, Ω m: a wire is between them."""
_ZERO_C = 273.15
_ROOM_K_OF_K = _ZERO_C + 18.0  # tinf of springProperties.py
_ROOM_C_OF_D = 25.0
_SPECIFIC_HEAT_OF_D = 837.0  # J/(kg K)
_LATENT_HEAT_OF_D = 24_200.0  # J/kg
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
_LONGEST_S = 300.0
_HEATED, _COOLED = 0.05, 0.875  # martensite: contracted; all but the last 0.5 % of 4 % strain back


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number. `ours` is None where the plant has no such law or lacks the geometry.

    stated: the interval that the source gives for it. fitted: the law of the pitch was made from
    it. with_heats: `ours` with the specific and the latent heat that D states.
    """

    what: str
    source: str
    value: float
    unit: str
    ours: Callable[[], float] | None = None
    missing: str = ""
    fitted: bool = False
    stated: tuple[float, float] | None = None
    with_heats: Callable[[], float] | None = None

    @property
    def ratio(self) -> float | None:
        """What the plant gives over what was published."""
        return None if self.ours is None else self.ours() / self.value

    @property
    def near(self) -> bool:
        """Whether ours is in the interval that is stated, or within NEAR where none is."""
        if self.ours is None:
            return False
        low, high = self.stated or ((1.0 - NEAR) * self.value, (1.0 + NEAR) * self.value)
        return low <= self.ours() <= high


def _base(heats_of_d: bool) -> ParameterSet:
    base = load_parameters("conserving")
    if not heats_of_d:
        return base
    return base.replace(
        heat_capacity_heating=_SPECIFIC_HEAT_OF_D,
        heat_capacity_cooling=_SPECIFIC_HEAT_OF_D,
        latent_heating=_LATENT_HEAT_OF_D,
        latent_cooling=_LATENT_HEAT_OF_D,
    )


def _with_alloy(base: ParameterSet, alloy: str, room_K: float) -> ParameterSet:
    a_s, a_f, m_s, m_f = (_ZERO_C + degC for degC in _ALLOYS[alloy])
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
    plant = Plant(parameters, cooling="air", fixture="stretch", laws=pitch_law(geometry))
    drive, step_s, rises = Drive((current_A, 0.0)), 0.1, []
    for _ in range(3000):
        plant.advance(drive, step_s)
        rises.append(plant.truth.T_K[0] - _ROOM_K_OF_K)
    return rises[-1], step_s * sum(1.0 - rise / rises[-1] for rise in rises)


@cache
def relaxing(
    geometry: Geometry,
    current_A: float,
    alloy: str,
    *,
    heats_of_d: bool = False,
    in_water: bool = False,
) -> tuple[float, float]:
    """How long an unloaded spring takes to contract, and then to relax without current, s.

    In still air, or in a bath: water that stays at the room's temperature, as in the variant
    "printed", with the wire's diameter for the film. Infinite where the current does not heat it
    through.
    """
    room_K = _ZERO_C + _ROOM_C_OF_D
    parameters = _with_alloy(scaled(_base(heats_of_d), geometry), alloy, room_K)
    if in_water:
        parameters = parameters.replace(tube_diameter=2.0 * parameters["wire_diameter"])
    plant = Plant(
        parameters,
        variant="printed" if in_water else "extended",
        cooling="water" if in_water else "air",
        fixture="stretch",
        laws=() if in_water else pitch_law(geometry),
    )
    step_s = 0.025 * geometry.wire_mm
    rise_K_per_s = heating_K_per_s(parameters, current_A)
    phases: list[tuple[Drive, float, Callable[[float], bool]]] = [
        (Drive((current_A, 0.0)), min(step_s, 0.5 / rise_K_per_s), lambda xi: xi <= _HEATED),
        (Drive(), step_s, lambda xi: xi >= _COOLED),
    ]
    times_s = []
    for drive, dt_s, done in phases:
        taken_s = 0.0
        while not done(plant.truth.xi[0]):
            if taken_s > _LONGEST_S:
                return math.inf, math.inf
            plant.advance(drive, dt_s)
            taken_s += dt_s
        times_s.append(taken_s)
    return times_s[0], times_s[1]


def wire(wire_mm: float) -> Geometry:
    """A straight wire: its coil and turns decide lengths only, which cancel."""
    return Geometry(wire_mm=wire_mm, coil_mm=10.0 * wire_mm, turns=20)


def _spring_of_l(wire_mm: float) -> Geometry:
    """A spring of L: ten wires outside, 50 mm long, turns by its resistance a metre of its wire."""
    coil_mm = 9.0 * wire_mm
    spring_Ohm, wire_Ohm_per_m, _, _ = _SPRINGS_OF_L[wire_mm]
    turns = 1e3 * spring_Ohm / wire_Ohm_per_m / (math.pi * coil_mm)
    return Geometry(
        wire_mm=wire_mm, coil_mm=coil_mm, turns=turns, pitch_mm=_LONG_MM_OF_L / turns - wire_mm
    )


def _force_of_l(wire_mm: float) -> Callable[[], float]:
    """Force of the hot spring, stretched from its free length by the largest stroke stated, N."""

    def force_N() -> float:
        *_, stroke_mm, current_A = _SPRINGS_OF_L[wire_mm]
        parameters = scaled(_base(False), _spring_of_l(wire_mm))
        plant = Plant(
            _with_alloy(parameters, "90 °C", _ZERO_C + _ROOM_C_OF_D),
            cooling="air",
            fixture="stretch",
        )
        drive = Drive((current_A, 0.0), stage_m=1e-3 * stroke_mm)
        while plant.truth.xi[0] > _HEATED:
            plant.advance(drive, 0.02)
        return plant.truth.spring_force_N[0]

    return force_N


def _relaxing_of_l(wire_mm: float, *, in_water: bool) -> Callable[[], float]:
    current_A = _SPRINGS_OF_L[wire_mm][3] * (10.0 if in_water else 1.0)
    return lambda: relaxing(_spring_of_l(wire_mm), current_A, "90 °C", in_water=in_water)[1]


def resistance_per_m(wire_mm: float) -> float:
    """Ohm a metre of wire."""
    return load_parameters("conserving")["resistivity"] / _section_m2(wire_mm)


def _section_m2(wire_mm: float) -> float:
    return 0.25e-6 * math.pi * wire_mm**2


def _stated_per_m(wire_mm: float) -> tuple[float, float]:
    martensite, austenite = (rho / _section_m2(wire_mm) for rho in _RESISTIVITY_OF_D)
    return martensite, austenite


def _phases_over_one_another() -> float:
    """Resistance of the hot spring over that of the cold one: the plant has one resistivity."""
    return 1.0


def _parameter(name: str) -> Callable[[], float]:
    return lambda: load_parameters("conserving")[name]


def _shear_slope() -> float:
    """Mean stress slope of the transformation lines, in shear, MPa/K."""
    base = load_parameters("conserving")
    return 0.5e-6 * (base["slope_austenite"] + base["slope_martensite"])


_HEAT = "the alloy's heat"
_NO_FLOW = "forced convection in air"
NUMBERS: tuple[Published, ...] = (
    Published(what="resistance of the spring", source="K", value=0.35, unit="Ω",
              stated=(0.35, 0.55),
              ours=lambda: resistance_per_m(0.51) * math.pi * 3.45e-3 * 8),
    Published(what="rise at 1 A, turns touching", source="K", value=85.3, unit="K",
              ours=lambda: heated_in_air(1.0, 0.0)[0], fitted=True),
    Published(what="rise at 1 A, pitch 3 mm", source="K", value=38.9, unit="K",
              ours=lambda: heated_in_air(1.0, 3.0)[0], fitted=True),
    Published(what="rise at 0.71 A, pitch 1.5 mm", source="K", value=32.7, unit="K",
              stated=(32.7, 42.3),
              ours=lambda: heated_in_air(0.5**0.5, 1.5)[0]),
    Published(what="time constant, turns touching", source="K", value=28.1, unit="s",
              ours=lambda: heated_in_air(1.0, 0.0)[1], missing=_HEAT,
              with_heats=lambda: heated_in_air(1.0, 0.0, True)[1]),
    Published(what="time constant, pitch 3 mm", source="K", value=12.8, unit="s",
              ours=lambda: heated_in_air(1.0, 3.0)[1], missing=_HEAT,
              with_heats=lambda: heated_in_air(1.0, 3.0, True)[1]),
    Published(what="stress slope of the lines, in shear (10.6 MPa/K / √3)", source="K", value=6.12,
              unit="MPa/K", ours=_shear_slope),
    Published(what="resistance, 0.076 mm wire", source="D", value=196.9, unit="Ω/m",
              ours=lambda: resistance_per_m(0.0762), stated=_stated_per_m(0.0762)),
    Published(what="resistance, 0.15 mm wire", source="D", value=51.2, unit="Ω/m",
              ours=lambda: resistance_per_m(0.1524), stated=_stated_per_m(0.1524)),
    Published(what="resistance, 0.25 mm wire", source="D", value=18.5, unit="Ω/m",
              ours=lambda: resistance_per_m(0.254), stated=_stated_per_m(0.254)),
    Published(what="resistance, 0.51 mm wire", source="D", value=4.3, unit="Ω/m",
              ours=lambda: resistance_per_m(0.508), stated=_stated_per_m(0.508)),
    Published(what="0.15 mm, 70 °C alloy: contracts at 0.4 A in", source="D", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.1524), 0.4, "70 °C")[0],
              with_heats=lambda: relaxing(wire(0.1524), 0.4, "70 °C", heats_of_d=True)[0],
              missing="D states one current for both alloys"),
    Published(what="0.15 mm, 90 °C alloy: contracts at 0.4 A in", source="D", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.1524), 0.4, "90 °C")[0],
              with_heats=lambda: relaxing(wire(0.1524), 0.4, "90 °C", heats_of_d=True)[0]),
    Published(what="0.15 mm, 70 °C alloy: relaxes in", source="D", value=2.0, unit="s",
              ours=lambda: relaxing(wire(0.1524), 0.4, "70 °C")[1],
              with_heats=lambda: relaxing(wire(0.1524), 0.4, "70 °C", heats_of_d=True)[1]),
    Published(what="0.15 mm, 90 °C alloy: relaxes in", source="D", value=1.2, unit="s",
              ours=lambda: relaxing(wire(0.1524), 0.4, "90 °C")[1],
              with_heats=lambda: relaxing(wire(0.1524), 0.4, "90 °C", heats_of_d=True)[1]),
    Published(what="0.076 mm, 70 °C alloy: contracts at 0.1 A in", source="D", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.0762), 0.1, "70 °C")[0],
              missing="the air film of thin wires"),
    Published(what="specific heat", source="D", value=_SPECIFIC_HEAT_OF_D, unit="J/(kg K)",
              ours=_parameter("heat_capacity_heating"), missing=_HEAT),
    Published(what="latent heat", source="D", value=_LATENT_HEAT_OF_D, unit="J/kg",
              ours=_parameter("latent_heating"), missing=_HEAT),
    Published(what="relaxing in flowing over still air (0.30 s / 1.6 s)", source="T",
              value=0.19, unit="", stated=(0.19, 0.28), missing=_NO_FLOW),
    Published(what="cooling in a grease-filled tube over air", source="N", value=0.7, unit="",
              missing="film and heat of grease or oil in the tube"),
    Published(what="cooling in an oil-filled tube over air", source="N", value=0.8, unit="",
              missing="the same"),
    Published(what="response at 3 A", source="C", value=26.0, unit="s",
              missing="the copper core; its dimensions"),
    Published(what="force, 0.5 mm spring", source="L", value=2.5, unit="N",
              stated=(2.0, 3.0), ours=_force_of_l(0.5)),
    Published(what="force, 1 mm spring", source="L", value=9.0, unit="N",
              stated=(8.0, 10.0), ours=_force_of_l(1.0)),
    Published(what="force, 2 mm spring", source="L", value=27.5, unit="N",
              stated=(25.0, 30.0), ours=_force_of_l(2.0)),
    Published(what="0.5 mm spring relaxes in air in", source="L", value=10.0, unit="s",
              stated=(5.0, 15.0), ours=_relaxing_of_l(0.5, in_water=False)),
    Published(what="1 mm spring relaxes in air in", source="L", value=25.0, unit="s",
              stated=(20.0, 30.0), ours=_relaxing_of_l(1.0, in_water=False)),
    Published(what="2 mm spring relaxes in air in", source="L", value=60.0, unit="s",
              ours=_relaxing_of_l(2.0, in_water=False)),
    Published(what="0.5 mm spring relaxes in water in", source="L", value=1.0, unit="s",
              ours=_relaxing_of_l(0.5, in_water=True)),
    Published(what="1 mm spring relaxes in water in", source="L", value=2.5, unit="s",
              stated=(2.0, 3.0), ours=_relaxing_of_l(1.0, in_water=True)),
    Published(what="2 mm spring relaxes in water in", source="L", value=6.0, unit="s",
              stated=(5.0, 7.0), ours=_relaxing_of_l(2.0, in_water=True)),
    Published(what="1 mm spring relaxes behind a fan in", source="L", value=11.5, unit="s",
              stated=(8.0, 15.0), missing=_NO_FLOW),
    Published(what="stroke, 1 mm spring", source="L", value=35.0, unit="mm",
              stated=(30.0, 40.0), missing="its load is not stated"),
    Published(what="2 mm wire at 15 A contracts in", source="L", value=35.3, unit="s",
              ours=lambda: relaxing(wire(2.0), 15.0, "90 °C")[0]),
    Published(what="resistance, austenite over martensite", source="L", value=0.94, unit="",
              ours=_phases_over_one_another),
    Published(what="resistance, austenite over martensite", source="D", value=1.25, unit="",
              ours=_phases_over_one_another),
    Published(what="resistance, 0.025 mm wire", source="M", value=1425.0, unit="Ω/m",
              ours=lambda: resistance_per_m(0.0254)),
    Published(what="resistance, 0.2 mm wire", source="M", value=29.0, unit="Ω/m",
              stated=_stated_per_m(0.2032), ours=lambda: resistance_per_m(0.2032)),
    Published(what="0.025 mm, 70 °C: contracts at 45 mA in", source="M", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.0254), 0.045, "70 °C")[0]),
    Published(what="0.025 mm, 70 °C: relaxes in", source="M", value=0.18, unit="s",
              ours=lambda: relaxing(wire(0.0254), 0.1, "70 °C")[1]),
    Published(what="0.025 mm, 90 °C: relaxes in", source="M", value=0.15, unit="s",
              ours=lambda: relaxing(wire(0.0254), 0.1, "90 °C")[1]),
    Published(what="0.076 mm, 70 °C: relaxes in", source="M", value=0.8, unit="s",
              stated=(0.5, 0.8), ours=lambda: relaxing(wire(0.0762), 0.2, "70 °C")[1]),
    Published(what="0.1 mm, 70 °C: relaxes in", source="M", value=1.1, unit="s",
              ours=lambda: relaxing(wire(0.1016), 0.3, "70 °C")[1]),
    Published(what="0.1 mm, 90 °C: relaxes in", source="M", value=0.9, unit="s",
              ours=lambda: relaxing(wire(0.1016), 0.3, "90 °C")[1]),
    Published(what="0.2 mm, 70 °C: contracts at 0.66 A in", source="M", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.2032), 0.66, "70 °C")[0]),
    Published(what="0.2 mm, 70 °C: relaxes in", source="M", value=3.2, unit="s",
              ours=lambda: relaxing(wire(0.2032), 0.66, "70 °C")[1]),
    Published(what="0.25 mm, 70 °C: relaxes in", source="M", value=5.4, unit="s",
              ours=lambda: relaxing(wire(0.254), 1.0, "70 °C")[1]),
    Published(what="0.51 mm, 90 °C: contracts at 4 A in", source="L", value=1.0, unit="s",
              ours=lambda: relaxing(wire(0.508), 4.0, "90 °C")[0]),
    Published(what="0.51 mm, 90 °C: relaxes in", source="L", value=14.0, unit="s",
              ours=lambda: relaxing(wire(0.508), 4.0, "90 °C")[1]),
    Published(what="specific heat", source="H", value=450.0, unit="J/(kg K)",
              ours=_parameter("heat_capacity_heating")),
    Published(what="latent heat", source="H", value=1.97e4, unit="J/kg",
              stated=(1.5e4, 1.97e4), ours=_parameter("latent_heating")),
)  # fmt: skip


def table() -> str:
    """The table of the page, with its sources."""
    lines = [
        "| published number | source | published | stated | smad | ratio | D's heats | what is"
        " missing |",
        "|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for number in NUMBERS:
        ours, ratio = "–", "–"
        if number.ours is not None and number.ratio is not None:
            given = number.ours()
            ours = "never" if math.isinf(given) else f"{given:.3g} {number.unit}"
            ratio = "–" if math.isinf(given) else f"{number.ratio:.2f}"
        mark = " (fitted)" if number.fitted else ""
        published = f"{number.value:.3g} {number.unit}".strip()
        low_high = () if number.stated is None else number.stated
        stated = " to ".join(f"{bound:.3g}" for bound in low_high)
        warm = "" if number.with_heats is None else f"{number.with_heats() / number.value:.2f}"
        lines.append(
            f"| {number.what}{mark} | {number.source} | {published} | {stated} | {ours} | {ratio} |"
            f" {warm} | {number.missing} |"
        )
    near, judged = near_of()
    inside, with_interval = inside_of()
    lines += [
        "",
        f"Within {NEAR:.0%}: {near} of {judged} that were not fitted. Only D states intervals, of"
        f" resistivity: {inside} of {with_interval} lie in them. *D's heats*: ratio with these.",
        "",
    ]
    lines += [f"- {key}: {source}" for key, source in SOURCES.items()]
    return "\n".join(lines)


def near_of() -> tuple[int, int]:
    """How many numbers that the plant computes and was not fitted to are near, and of how many."""
    ratios = [n.ratio for n in NUMBERS if n.ratio is not None and not n.fitted]
    return sum(abs(ratio - 1.0) <= NEAR for ratio in ratios), len(ratios)


def inside_of() -> tuple[int, int]:
    """How many numbers lie in the interval that their source states, and how many have one."""
    stated = [n for n in NUMBERS if n.stated is not None]
    return sum(n.near for n in stated), len(stated)


if __name__ == "__main__":
    print(table())
