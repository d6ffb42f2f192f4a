"""The full stroke of a pair, to and fro, on the simulated plant: what can be got out of it.

The paper's four steps: one spring is heated with the full current until it is austenite, and cools
until it is martensite; then the other. After a first cycle from rest the second one is measured.
Control that heats one spring while the other still cools is faster and pulls harder.
"""

import math
from dataclasses import asdict, dataclass

from sim_device.plant import Drive, Plant
from sim_device.plant.geometry import (
    AirFilm,
    Geometry,
    air_film,
    heating_K_per_s,
    scaled,
    section_m2,
)
from sim_device.plant.parameters import ParameterSet, spring_factors
from sim_device.plant.units import ZERO_C
from smad.design.checked import DesignError, anneals_s, outside, refuse_fan, refuse_impossible
from smad.report.page import Page, Section, Table, Text

DT_S = 0.02
STEP_K = 0.5
"""A spring that heats faster than STEP_K in DT_S is computed in shorter steps."""
HOT_FRACTION, COLD_FRACTION = 0.02, 0.9
"""Martensite left of a spring that counts as heated through, and of one that counts as cooled."""
LONGEST_S = 900.0
"""Of heating, and of cooling."""
CYCLES = 2


@dataclass(frozen=True, kw_only=True)
class Design:
    """What a pair gives. Stroke is half the way from end to end; powers are the pair's.

    outside: what lies outside the range in which the model was checked.
    """

    stroke_mm: float
    force_hot_N: float
    force_rest_N: float
    period_s: float
    heating_s: float
    power_W: float
    peak_power_W: float
    prestrain: float
    resistance_Ohm: float
    wire_m: float
    mass_g: float
    stress_MPa: float
    peak_degC: float
    anneals_s: float
    outside: tuple[str, ...]

    def rows(self) -> list[tuple[str, str]]:
        """Quantity and value, as a table shows them."""
        values = asdict(self)
        return [(words, form.format(values[name])) for name, words, form in _WORDS]


_WORDS = (
    ("stroke_mm", "stroke to either side", "{:.2f} mm"),
    ("force_hot_N", "tension at its end", "{:.3f} N"),
    ("force_rest_N", "least tension", "{:.3f} N"),
    ("stress_MPa", "largest shear stress", "{:.0f} MPa"),
    ("period_s", "period, to and fro", "{:.1f} s"),
    ("heating_s", "of which one spring heats through in", "{:.2g} s"),
    ("power_W", "mean electrical power", "{:.2f} W"),
    ("peak_power_W", "largest electrical power", "{:.2f} W"),
    ("peak_degC", "hottest wire", "{:.0f} °C"),
    ("anneals_s", "500 °C, if the current stays on, not before", "{:.2g} s"),
    ("prestrain", "shear strain as mounted", "{:.4f}"),
    ("resistance_Ohm", "resistance of a spring", "{:.3f} Ω"),
    ("wire_m", "wire of a spring", "{:.3f} m"),
    ("mass_g", "mass of a spring", "{:.3f} g"),
)


def design_cycle(
    base: ParameterSet,
    geometry: Geometry,
    *,
    current_A: float = 4.0,
    cooling: str = "water",
    air_m_per_s: float = 0.0,
) -> Design:
    """Run the pair through `CYCLES` full strokes and measure the last.

    base: the alloy, and what is not scaled (`sim_device.plant.geometry`). cooling: "water" in the
    tube at full flow while a spring cools, "bath", or "air": still, where the pitch counts, or that
    of a fan, `air_m_per_s`. Raises DesignError for
    a spring that takes longer than LONGEST_S and for what cannot be, ParameterError for parameters
    out of range.
    """
    parameters = scaled(base, geometry)
    refuse_impossible(parameters, geometry, current_A)
    refuse_fan(cooling, air_m_per_s)
    film = AirFilm(laws=(), effects={})
    if cooling == "air":
        film = air_film(parameters, geometry, air_m_per_s=air_m_per_s)
    plant = Plant(parameters, cooling=cooling, **film)
    heating_step_s = min(DT_S, STEP_K / heating_K_per_s(parameters, current_A))
    c1, c2 = spring_factors(parameters)
    seen = _Seen()
    for _ in range(CYCLES):
        seen = _Seen()
        for heated in (0, 1):
            _half(plant, heated, current_A, heating_step_s, seen)
    wire_m = math.pi * parameters["coil_diameter"] * parameters["coils"]
    section = section_m2(parameters)
    return Design(
        stroke_mm=0.5e3 * (seen.high_m - seen.low_m),
        force_hot_N=seen.most_N,
        force_rest_N=seen.least_N,
        period_s=seen.time_s,
        heating_s=seen.heating_s / 2.0,
        power_W=seen.energy_J / seen.time_s,
        peak_power_W=seen.peak_W,
        prestrain=c2 * parameters["initial_deflection"],
        resistance_Ohm=plant.truth.resistance_Ohm[0],
        wire_m=wire_m,
        mass_g=1e3 * parameters["density"] * section * wire_m,
        stress_MPa=1e-6 * c1 * seen.most_N,
        peak_degC=seen.peak_K - ZERO_C,
        anneals_s=anneals_s(parameters, current_A),
        outside=outside(
            parameters,
            geometry,
            current_A,
            cooling=cooling,
            stress_MPa=1e-6 * c1 * seen.most_N,
            peak_degC=seen.peak_K - ZERO_C,
        ),
    )


@dataclass
class _Seen:
    """What a cycle gave so far."""

    time_s: float = 0.0
    heating_s: float = 0.0
    energy_J: float = 0.0
    high_m: float = float("-inf")
    low_m: float = float("inf")
    most_N: float = 0.0
    least_N: float = float("inf")
    peak_W: float = 0.0
    peak_K: float = 0.0


def _half(plant: Plant, heated: int, current_A: float, step_s: float, seen: _Seen) -> None:
    """One spring heats through and cools again; what it does goes into `seen`.

    Raises DesignError where one of both takes too long.
    """
    hot_A = (current_A, 0.0) if heated == 0 else (0.0, current_A)
    heating_s = _drive(plant, heated, Drive(hot_A), step_s, seen, heats=True)
    duty = (1.0, 0.0) if heated == 0 else (0.0, 1.0)
    cooling_s = _drive(plant, heated, Drive((0.0, 0.0), duty), DT_S, seen, heats=False)
    seen.heating_s += heating_s
    seen.time_s += heating_s + cooling_s


def _drive(
    plant: Plant, spring: int, drive: Drive, step_s: float, seen: _Seen, *, heats: bool
) -> float:
    """Drive a spring until it is heated through, or has cooled; return for how long, in s."""
    elapsed_s, current_A = 0.0, drive.i_A[spring]
    while plant.xi[spring] > HOT_FRACTION if heats else plant.xi[spring] < COLD_FRACTION:
        if elapsed_s > LONGEST_S:
            raise DesignError(
                f"a spring does not {'heat through' if heats else 'cool'} within {LONGEST_S:g} s",
                value=f"{plant.truth.T_K[spring] - ZERO_C:.1f} °C",
                action="take more current, or thinner wire"
                if heats
                else "cool it with water, or take thinner wire",
            )
        plant.advance(drive, step_s)
        elapsed_s += step_s
        now = plant.truth
        power_W = current_A * current_A * now.resistance_Ohm[spring]
        seen.energy_J += power_W * step_s
        seen.peak_W = max(seen.peak_W, power_W)
        seen.high_m = max(seen.high_m, now.displacement_m)
        seen.low_m = min(seen.low_m, now.displacement_m)
        seen.most_N = max(seen.most_N, now.force_N)
        seen.least_N = min(seen.least_N, now.force_N)
        seen.peak_K = max(seen.peak_K, now.T_K[spring])
    return elapsed_s


_HEADER = ("quantity", "value")
_ALLOY = (
    "The alloy is not scaled; its published numbers beside those of other laboratories are in "
    "docs/physics.md."
)


def design_page(
    design: Design,
    geometry: Geometry,
    alloy: str,
    *,
    current_A: float,
    cooling: str,
    air_m_per_s: float = 0.0,
) -> Page:
    """Return the page: what the pair gives, and for what geometry, current and cooling."""
    sizes = [(name, f"{value:g}") for name, value in asdict(geometry).items() if value is not None]
    fan = [("air_m_per_s", f"{air_m_per_s:g}")] if air_m_per_s else []
    sizes += [("current_A", f"{current_A:g}"), ("cooling", cooling), *fan, ("alloy", alloy)]
    return Page(
        title="Design of a pair of springs",
        lead="What the simulated pair gives over a full stroke to and fro.",
        facts=[],
        sections=[
            Section("What it gives", [Table(_HEADER, design.rows())]),
            Section(
                "For this geometry",
                [
                    Table(_HEADER, sizes),
                    *(Text(f"Outside what was checked: {remark}.") for remark in design.outside),
                    Text(_ALLOY, kind="note"),
                ],
            ),
        ],
    )
