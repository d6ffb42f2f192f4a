"""Names of units: how they are spelt, at the ends of names, and as a person reads them."""

import math
import re
from collections.abc import Mapping, Sequence

from sim_device.plant.units import UNITS

SPELLINGS: Mapping[str, str] = {
    "°C": "degC", "℃": "degC", "ºC": "degC", "°F": "degF", "ºF": "degF", "° C": "degC",
    "° F": "degF", "deg C": "degC", "deg F": "degF", "C": "degC", "F": "degF", "celsius": "degC",
    "fahrenheit": "degF", "µs": "us", "μs": "us", "µm": "um", "μm": "um", "µA": "uA", "μA": "uA",
    "µV": "uV", "μV": "uV", "%": "pct", "percent": "pct", "prozent": "pct", "°": "deg",
    "sec": "s", "msec": "ms", "seconds": "s", "sekunden": "s", "milliseconds": "ms",
    "minutes": "min", "hours": "h", "volt": "V", "volts": "V", "ampere": "A", "amps": "A",
    "newton": "N", "Nm": "N m", "mNm": "mN m", "N·m": "N m", "N*m": "N m",
    "°/s": "deg/s", "r/min": "rpm", "1/min": "rpm", "°C/s": "K/s", "C/s": "K/s",
}  # fmt: skip
"""Other ways to write a unit of the table; words in small or capital letters."""


_WORDS = ("in", "h", "min", "g", "1")
"""Units of the table that are words as well: a name that ends so, "flow_in", may mean these."""
_ABBREVIATED: dict[str, str] = {
    "Nm": "N m", "J_K": "J/K", "W_K": "W/K", "K_W": "K/W", "W_m2K": "W/(m² K)",
    "N_m_A": "N m/A", "N_m_s": "N m s", "N_m_s_rad": "N m s/rad", "N_m_rad": "N m/rad",
    "N_s_m": "N s/m", "V_s_rad": "V s/rad", "N_A": "N/A", "J_kg": "J/kg", "kg_m2": "kg m²",
    "m_s2": "m/s²", "rad_s2": "rad/s²", "m3_s": "m³/s", "1_s": "1/s", "Hz": "Hz", "Ohm": "Ohm",
    "J": "J",
}  # fmt: skip
_ALL = {re.sub("[ /]", "_", unit): unit for unit in UNITS if unit not in _WORDS} | _ABBREVIATED
_ENDINGS = dict(sorted(_ALL.items(), key=lambda pair: -len(pair[0])))
"""How the name of a column or a parameter ends, after a "_", and its unit; longer ones first."""


_MORE = ("L", "mL", "J", "kJ", "Hz", "Ohm", "Ah", "Wh", "m2", "m3", "mol")
"""Parts of compound units that are no units of the table."""
_SYMBOLS = {"m": "mass", "L": "length", "s": "length", "K": "", "V": "voltage"}
"""Units that are symbols of a quantity as well: "arm_m_kg" is a mass, no metre for a kilogram."""
_TIMES = {("N", "m"), ("N", "mm"), ("N", "s"), ("V", "s"), ("W", "s"), ("A", "s"), ("A", "h")}
"""Of the units at the beginning of a compound, those that are multiplied."""
BRACKETED = re.compile(r"^(?P<stem>.+?)[\s_]*[\[(](?P<unit>[^\])]*)[\])]$")
"""A name that ends with something in brackets, as a unit is: `Force [mN]`."""


def parted_name(name: str) -> tuple[str, str]:
    """The quantity in a name, and its unit: "torque", "N m" of "torque_N_m" or "torque [Nm]".

    The unit is "" where it has none. A rate of what is measured (`angle_rad_rate`) has the unit of
    that, in a second. A compound that is not listed is divided by what follows its first unit:
    "leak_L_min_bar" is in L/(min bar).
    """
    if name.endswith("_rate"):
        stem, unit = parted_name(name.removesuffix("_rate"))
        return f"{stem}_rate", f"{unit}/s" if unit else ""
    bracketed = BRACKETED.match(name.strip())
    if bracketed and (unit := spelt(bracketed["unit"])) != "1" and unit in UNITS:
        return bracketed["stem"], unit
    stem, _, below = name.rpartition("_per_")
    if stem and all(spelt(word) in UNITS for word in below.split("_")):
        stem, above = parted_name(stem)
        below = " ".join(below.split("_"))
        return stem, f"{above}/({below})" if " " in below else f"{above}/{below}"
    ending = next((end for end in _ENDINGS if name.endswith(f"_{end}")), "")
    units = [] if "_" in ending else _compound(name)
    if len(units) > 1:
        stem, unit = name.removesuffix(f"_{'_'.join(units)}"), _joined(units)
    else:
        unit = spelt(_ENDINGS.get(ending, ""))
        stem = name.removesuffix(f"_{ending}") if ending else name
    if stem.endswith("stiffness") and unit in {"N m", "N mm"}:
        unit = unit.replace(" ", "/")
    return stem, unit


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


def units_for(unit: str) -> list[str]:
    """The units that can be converted to `unit`, itself included."""
    if unit not in UNITS:
        return [unit]
    return [name for name, other in UNITS.items() if other.si == UNITS[unit].si]


def alternatives(unit: str) -> str:
    """The units that can be converted to `unit`, with other ways to write them."""
    spellings = {u: [s for s, of in SPELLINGS.items() if of == u] for u in units_for(unit)}
    return ", ".join(f"{u} ({spellings[u][0]})" if spellings[u] else u for u in spellings)


def in_words(unit: str) -> str:
    """A unit as a person reads it, "°C/s" for "degC/s"; empty for numbers without one."""
    return "" if unit == "1" else re.sub(r"degC|deg|Ohm|um|pct", lambda part: _READ[part[0]], unit)


def range_in_words(low: float, high: float, unit: str = "", *, above: bool = False) -> str:
    """A range as a person reads it: `1 to 5 mm`, `at least 1 mm`; `above`: without its lower end.

    Empty for a range without ends.
    """
    suffix = f" {in_words(unit)}".rstrip()
    if math.isinf(low):
        return "" if math.isinf(high) else f"at most {high:.10g}{suffix}"
    if math.isinf(high):
        return f"{'above' if above else 'at least'} {low:.10g}{suffix}"
    if above:
        return f"above {low:.10g}, up to {high:.10g}{suffix}"
    return f"{low:.10g} to {high:.10g}{suffix}"


_READ = {"degC": "°C", "deg": "°", "Ohm": "Ω", "um": "µm", "pct": "%"}
