"""Units that a foreign log may use, and how they become the units of the schema."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
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
    "kg": Unit("mass", 1.0),
    "g": Unit("mass", 1e-3),
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
    "rev": Unit("angle", 360.0),
    "m/s": Unit("speed", 1.0),
    "cm/s": Unit("speed", 1e-2),
    "mm/s": Unit("speed", 1e-3),
    "deg/s": Unit("rate of turning", 1.0),
    "rad/s": Unit("rate of turning", 180.0 / np.pi),
    "rpm": Unit("rate of turning", 6.0),
    "N m": Unit("torque", 1.0),
    "mN m": Unit("torque", 1e-3),
    "Pa": Unit("pressure", 1.0),
    "kPa": Unit("pressure", 1e3),
    "bar": Unit("pressure", 1e5),
    "1": Unit("ratio", 1.0),
    "pct": Unit("ratio", 1e-2),
}


SPELLINGS: Mapping[str, str] = {
    "°C": "degC", "℃": "degC", "ºC": "degC", "°F": "degF", "ºF": "degF", "° C": "degC",
    "° F": "degF", "deg C": "degC", "deg F": "degF", "C": "degC", "F": "degF", "celsius": "degC",
    "fahrenheit": "degF", "µs": "us", "μs": "us", "µm": "um", "μm": "um", "µA": "uA", "μA": "uA",
    "µV": "uV", "μV": "uV", "%": "pct", "percent": "pct", "prozent": "pct", "°": "deg",
    "sec": "s", "msec": "ms", "seconds": "s", "sekunden": "s", "milliseconds": "ms",
    "minutes": "min", "hours": "h", "volt": "V", "volts": "V", "ampere": "A", "amps": "A",
    "newton": "N", "Nm": "N m", "mNm": "mN m", "N·m": "N m", "°/s": "deg/s", "r/min": "rpm",
    "1/min": "rpm",
}  # fmt: skip
"""Other ways to write a unit of the table; words in small or capital letters."""


_WORDS = ("in", "h", "min", "g", "1")
"""Units of the table that are words as well: a name that ends so, "flow_in", may mean these."""
_ENDINGS: Mapping[str, str] = dict(sorted(
    {
        **{re.sub("[ /]", "_", unit): unit for unit in UNITS if unit not in _WORDS},
        "Nm": "N m", "J_K": "J/K", "W_K": "W/K", "K_W": "K/W", "W_m2K": "W/(m² K)",
        "N_m_A": "N m/A", "N_m_s": "N m s", "N_m_s_rad": "N m s/rad", "N_m_rad": "N m/rad",
        "N_s_m": "N s/m", "V_s_rad": "V s/rad", "N_A": "N/A", "J_kg": "J/kg", "kg_m2": "kg m²",
        "m_s2": "m/s²", "rad_s2": "rad/s²", "m3_s": "m³/s", "1_s": "1/s", "Hz": "Hz", "Ohm": "Ohm",
        "J": "J",
    }.items(),
    key=lambda pair: -len(pair[0]),
))  # fmt: skip
"""How the name of a column or a parameter ends, after a "_", and its unit; longer ones first."""


_MORE = ("L", "mL", "J", "kJ", "Hz", "Ohm", "Ah", "Wh", "m2", "m3", "mol")
"""Parts of compound units that are no units of the table."""
_SYMBOLS = {"m": "mass", "L": "length", "s": "length", "K": "", "V": "voltage"}
"""Units that are symbols of a quantity as well: "arm_m_kg" is a mass, no metre for a kilogram."""
_TIMES = {("N", "m"), ("N", "mm"), ("N", "s"), ("V", "s"), ("W", "s"), ("A", "s"), ("A", "h")}
"""Of the units at the beginning of a compound, those that are multiplied."""


def parted_name(name: str) -> tuple[str, str]:
    """The quantity in a name, and its unit: "torque", "N m" of "torque_N_m"; "" where it has none.

    A rate of what is measured (`angle_rad_rate`) has the unit of that, in a second. A compound that
    is not listed is divided by what follows its first unit: "leak_L_min_bar" is in L/(min bar).
    """
    base = name.removesuffix("_rate")
    ending = next((end for end in _ENDINGS if base.endswith(f"_{end}")), "")
    units = [] if "_" in ending else _compound(base)
    if len(units) > 1:
        stem, unit = base.removesuffix(f"_{'_'.join(units)}"), _joined(units)
    else:
        unit = spelt(_ENDINGS.get(ending, ""))
        stem = base.removesuffix(f"_{ending}") if ending else base
    if stem.endswith("stiffness") and unit in {"N m", "N mm"}:
        unit = unit.replace(" ", "/")
    return (f"{stem}_rate", f"{unit}/s" if unit else "") if base != name else (stem, unit)


def _compound(name: str) -> list[str]:
    """The units at the end of a name, after its first word."""
    words = name.split("_")[1:]
    units: list[str] = []
    while words and (spelt(words[-1]) in UNITS or words[-1] in _MORE):
        units.insert(0, words.pop())
    while len(units) > 1:
        symbol = _SYMBOLS.get(units[0])
        of = UNITS[spelt(units[1])].quantity if spelt(units[1]) in UNITS else ""
        if units[0] not in _WORDS and (symbol is None or symbol not in {"", of}):
            break
        del units[0]
    return units


def _joined(units: Sequence[str]) -> str:
    count = 2 if tuple(units[:2]) in _TIMES else 1
    above, below = " ".join(units[:count]), " ".join(units[count:])
    return f"{above}/({below})" if " " in below else f"{above}/{below}" if below else above


def unit_of(name: str) -> str:
    """The unit that a name ends with; empty where it ends with none."""
    return parted_name(name)[1]


def spelt(unit: str) -> str:
    """The unit as the table has it; one that it does not have stays as it is."""
    word = unit.strip()
    return SPELLINGS.get(word) or (SPELLINGS.get(word.lower(), word) if len(word) > 2 else word)


def is_unit(word: str) -> bool:
    """Whether a word is a unit of the table, or stands for none."""
    return spelt(word) in UNITS or word.strip() in ("-", "–")


@dataclass(frozen=True)
class Written:
    """How a column stands in its file: value = number · `scale` + `offset`, the number in `unit`.

    `unit` is empty where the file has the unit of the value.
    """

    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def of(cls, unit: str, to: str, scale: float = 1.0, offset: float = 0.0) -> Written:
        """The number · `scale` + `offset` is in `unit`, the value in the unit `to`."""
        zero, one = convert(np.array([offset, offset + scale]), unit, to).tolist()
        return cls(unit if unit != to else "", one - zero, zero)

    def numbers(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The numbers in the file of values, shape (n,)."""
        return (values - self.offset) / self.scale if self.scale else values

    def values(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values of numbers in the file, shape (n,)."""
        return numbers * self.scale + self.offset


def convert(values: NDArray[np.float64], unit: str, to: str) -> NDArray[np.float64]:
    """`values`, shape (n,), from `unit` to `to`. Raises LogImportError when these do not fit."""
    if unit == to:
        return values
    if unit not in units_for(to):
        raise LogImportError(
            f"{unit} is no unit for a value in {to}",
            value=unit,
            limit=unit_words(to),
            action="correct the unit",
        )
    source, target = UNITS[unit], UNITS[to]
    return (values * source.scale + (source.offset - target.offset)) / target.scale


def units_for(unit: str) -> list[str]:
    """The units that can be converted to `unit`, itself included."""
    if unit not in UNITS:
        return [unit]
    return [name for name, other in UNITS.items() if other.quantity == UNITS[unit].quantity]


def unit_words(unit: str) -> str:
    """The units that can be converted to `unit`, with other ways to write them."""
    others = {u: [s for s, of in SPELLINGS.items() if of == u] for u in units_for(unit)}
    return ", ".join(f"{u} ({others[u][0]})" if others[u] else u for u in others)
