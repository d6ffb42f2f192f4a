"""Where the model was checked, and what a wire does not survive.

Inside the ranges are set A's springs and those of docs/physics.md that the plant comes near to.
"""

import math

from sim_device.plant.geometry import (
    PITCH_MOST,
    SLOWEST_FAN_M_PER_S,
    Geometry,
    heating_K_per_s,
    section_m2,
)
from sim_device.plant.parameters import ParameterSet, spring_factors
from smad.errors import SmadError

ANNEAL_K, MELT_K = 773.0, 1573.0
"""Springs get their shape at 500 °C; NiTi melts at 1300 °C (Dynalloy, F1140)."""
SLOWEST_SAMPLE_S = 0.01
"""Of a board: a current that melts a wire sooner cannot be switched off in time."""
FASTEST_FAN_M_PER_S = 50.0
BOILS_DEGC = 100.0
SAFE_MPA = 172.0 / math.sqrt(3.0)
"""Shear stress for many cycles; Dynalloy states 172 MPa in tension."""
_CHECKED = {
    "wire": ("mm", 0.08, 1.0),
    "coil over wire": ("", 6.0, 10.0),
    "turns": ("", 7.0, 21.0),
    "current density": ("A/mm²", 0.5, 25.0),
    "tube less wire": ("mm", 0.8, 0.85),
}


class DesignError(SmadError):
    """A pair that cannot be, or cannot make its stroke."""


def anneals_s(parameters: ParameterSet, current_A: float) -> float:
    """Earliest time at which a current that stays on anneals the wire: without losses."""
    rise_K = ANNEAL_K - parameters["ambient_temperature"]
    latent_K = parameters["latent_heating"] / parameters["heat_capacity_heating"]
    return (rise_K + latent_K) / heating_K_per_s(parameters, current_A)


def refuse_impossible(parameters: ParameterSet, geometry: Geometry, current_A: float) -> None:
    """Raise DesignError for a pair that cannot be built, or whose wire melts."""
    if geometry.tube_mm is not None and geometry.tube_mm >= geometry.coil_mm:
        raise DesignError(
            "the tube around the wire does not fit into the coil",
            value=f"tube_mm {geometry.tube_mm:g}",
            limit=f"below coil_mm {geometry.coil_mm:g}",
        )
    strain = spring_factors(parameters)[1] * parameters["initial_deflection"]
    most = (
        spring_factors(parameters)[1] * parameters["max_deflection"]
        + parameters["stress_finish"] / parameters["modulus_martensite"]
    )
    if strain > most:
        raise DesignError(
            "more prestrain than martensite recovers",
            value=f"prestrain {strain:.3g}",
            limit=f"up to {most:.3g}",
        )
    hottest_K = parameters["ambient_temperature"] + SLOWEST_SAMPLE_S * heating_K_per_s(
        parameters, current_A
    )
    if hottest_K > MELT_K:
        raise DesignError(
            f"the wire melts within {1e3 * SLOWEST_SAMPLE_S:g} ms, before a board switches it off",
            value=f"{current_A:g} A",
            action="take less current, or a thicker wire",
        )


def refuse_fan(cooling: str, air_m_per_s: float) -> None:
    """Raise DesignError for a fan without air, or so slow or fast that its film is not known."""
    if air_m_per_s and cooling != "air":
        raise DesignError(
            "a fan needs air", value=f"cooling {cooling}", action="cool with air, or leave it out"
        )
    if air_m_per_s and not SLOWEST_FAN_M_PER_S <= air_m_per_s <= FASTEST_FAN_M_PER_S:
        raise DesignError(
            "the film of a fan this slow or fast is not known",
            value=f"{air_m_per_s:g} m/s",
            limit=f"{SLOWEST_FAN_M_PER_S:g} to {FASTEST_FAN_M_PER_S:g} m/s, or 0 for still air",
        )


def outside(
    parameters: ParameterSet,
    geometry: Geometry,
    current_A: float,
    *,
    cooling: str,
    stress_MPa: float,
    peak_degC: float,
) -> tuple[str, ...]:
    """What of a design lies outside the range that was checked, a sentence each."""
    gap_mm = 1e3 * (parameters["tube_diameter"] - parameters["wire_diameter"])
    values = {
        "wire": geometry.wire_mm,
        "coil over wire": geometry.coil_mm / geometry.wire_mm,
        "turns": geometry.turns,
        "current density": 1e-6 * current_A / section_m2(parameters),
    }
    if cooling == "water":
        values["tube less wire"] = gap_mm
    out = [
        f"{name} {values[name]:.3g}{unit and f' {unit}'}: checked from {low:g} to {high:g}"
        for name, (unit, low, high) in _CHECKED.items()
        if name in values and not low <= values[name] <= high
    ]
    if cooling != "air" and peak_degC >= BOILS_DEGC:
        out.append(f"hottest wire {peak_degC:.0f} °C: water boils there, which is not modelled")
    if geometry.pitch_mm is not None and geometry.pitch_mm > PITCH_MOST * geometry.wire_mm:
        out.append(f"pitch {geometry.pitch_mm:g} mm: measured to {PITCH_MOST:g} wires")
    if stress_MPa > SAFE_MPA:
        out.append(f"shear stress {stress_MPa:.0f} MPa: above {SAFE_MPA:.0f} MPa it fatigues soon")
    length_m = math.pi * parameters["coil_diameter"] * parameters["coils"]
    needed_V = current_A * parameters["resistivity"] * length_m / section_m2(parameters)
    supply_V = parameters["supply_voltage"]
    if needed_V > supply_V:
        out.append(f"current {current_A:g} A: needs {needed_V:.3g} V, the supply has {supply_V:g}")
    soon_s = anneals_s(parameters, current_A)
    if soon_s < 1.0:
        out.append(f"current {current_A:g} A: left on, it may anneal the wire after {soon_s:.2g} s")
    return tuple(out)
