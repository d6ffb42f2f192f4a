"""Units that a foreign log may use, and how they become the units of the schema."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smad.errors import LogImportError


@dataclass(frozen=True)
class Unit:
    """A unit: value in the base unit of its `quantity` = value · `scale` + `offset`."""

    quantity: str
    scale: float
    offset: float = 0.0


UNITS: Mapping[str, Unit] = {
    "s": Unit("time", 1.0),
    "ms": Unit("time", 1e-3),
    "us": Unit("time", 1e-6),
    "ns": Unit("time", 1e-9),
    "min": Unit("time", 60.0),
    "h": Unit("time", 3600.0),
    "K": Unit("temperature", 1.0),
    "degC": Unit("temperature", 1.0, 273.15),
    "degF": Unit("temperature", 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0),
    "cC": Unit("temperature", 0.01, 273.15),
    "m": Unit("length", 1.0),
    "cm": Unit("length", 1e-2),
    "mm": Unit("length", 1e-3),
    "um": Unit("length", 1e-6),
    "in": Unit("length", 25.4e-3),
    "N": Unit("force", 1.0),
    "mN": Unit("force", 1e-3),
    "kN": Unit("force", 1e3),
    "gf": Unit("force", 9.80665e-3),
    "kgf": Unit("force", 9.80665),
    "lbf": Unit("force", 4.4482216152605),
    "A": Unit("current", 1.0),
    "mA": Unit("current", 1e-3),
    "uA": Unit("current", 1e-6),
    "W": Unit("power", 1.0),
    "mW": Unit("power", 1e-3),
    "kW": Unit("power", 1e3),
    "V": Unit("voltage", 1.0),
    "mV": Unit("voltage", 1e-3),
    "uV": Unit("voltage", 1e-6),
    "deg": Unit("angle", 1.0),
    "rad": Unit("angle", 180.0 / np.pi),
    "1": Unit("ratio", 1.0),
    "pct": Unit("ratio", 1e-2),
}


SPELLINGS: Mapping[str, str] = {
    "°C": "degC", "℃": "degC", "ºC": "degC", "°F": "degF", "ºF": "degF",
    "µs": "us", "μs": "us", "µm": "um", "μm": "um", "µA": "uA", "μA": "uA", "µV": "uV", "μV": "uV",
    "%": "pct", "°": "deg", "sec": "s", "msec": "ms", "hours": "h", "Volt": "V", "Ampere": "A",
}  # fmt: skip
"""Other ways to write a unit of the table."""


def spelt(unit: str) -> str:
    """The unit as the table has it; one that it does not have stays as it is."""
    return SPELLINGS.get(unit.strip(), unit.strip())


def is_unit(word: str) -> bool:
    """Whether a word is a unit of the table, or stands for none."""
    return spelt(word) in UNITS or word.strip() in ("-", "–")


def convert(values: NDArray[np.float64], unit: str, to: str) -> NDArray[np.float64]:
    """`values`, shape (n,), from `unit` to `to`. Raises LogImportError when these do not fit."""
    if unit == to:
        return values
    known = units_for(to)
    if unit not in known:
        raise LogImportError(
            f"{unit} is no unit for a value in {to}",
            value=unit,
            limit=", ".join(known),
            action="correct the unit",
        )
    source, target = UNITS[unit], UNITS[to]
    return (values * source.scale + (source.offset - target.offset)) / target.scale


def units_for(unit: str) -> list[str]:
    """The units that can be converted to `unit`, itself included."""
    if unit not in UNITS:
        return [unit]
    return [name for name, other in UNITS.items() if other.quantity == UNITS[unit].quantity]
