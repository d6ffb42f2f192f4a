"""Units: of a column by its name, and how one is converted to that of a model."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

from smad.simulators.errors import SimulatorError

_ENDINGS: Mapping[str, str] = {
    "J_K": "J/K", "W_K": "W/K", "N_s_m": "N s/m", "N_m_s": "N m s", "J_kg": "J/kg",
    "m_s2": "m/s²", "rad_s2": "rad/s²", "rad_s": "rad/s", "deg_s": "deg/s", "mm_s": "mm/s",
    "m_s": "m/s", "m3_s": "m³/s", "N_m": "N m", "Nm": "N m", "degC": "degC", "rad": "rad",
    "deg": "deg", "rpm": "rpm", "mm": "mm", "Hz": "Hz", "kPa": "kPa", "Pa": "Pa", "bar": "bar",
    "mA": "mA", "mV": "mV", "Ohm": "Ohm", "kg": "kg", "ms": "ms", "W": "W", "N": "N", "m": "m",
    "s": "s", "A": "A", "V": "V", "K": "K", "J": "J",
}  # fmt: skip
"""How the name of a column ends, after a "_", and its unit; longer ones first."""


def unit_of(name: str) -> str:
    """The unit in the name of a column: "N m" of "torque_N_m"; "" where it has none."""
    base = name.removesuffix("_rate")
    unit = next((unit for end, unit in _ENDINGS.items() if base.endswith(f"_{end}")), "")
    return f"{unit}/s" if unit and base != name else unit


_SI: Mapping[str, tuple[str, float]] = {
    "deg": ("rad", pi / 180), "rad": ("rad", 1.0), "rev": ("rad", 2 * pi),
    "deg/s": ("rad/s", pi / 180), "rad/s": ("rad/s", 1.0), "rpm": ("rad/s", pi / 30),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "cm": ("m", 1e-2),
    "m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3), "cm/s": ("m/s", 1e-2),
    "N m": ("N m", 1.0), "mN m": ("N m", 1e-3), "N": ("N", 1.0), "kN": ("N", 1e3),
}  # fmt: skip
"""Unit -> the one of SI of its kind, and what it is in that."""


def in_si(unit: str, wanted: str, what: str) -> float:
    """What one `unit` is in the SI unit `wanted`; 1 for a unit that is not given.

    Raises SimulatorError for a unit that is not known, or is of another kind.
    """
    if not unit:
        return 1.0
    known = _SI.get(unit)
    if known is None or known[0] != wanted:
        kinds = ", ".join(u for u, (si, _) in _SI.items() if si == wanted)
        raise SimulatorError(
            f"{what}: the unit contradicts the model's, which is {wanted}",
            value=unit,
            limit=kinds or wanted,
            action="correct the unit, or name another part of the model",
        )
    return known[1]
