"""Names of units: how they are spelt, at the ends of names, and as a person reads them."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache

from sim_device.plant.units import UNITS, Unit

SPELLINGS: Mapping[str, str] = {
    "°C": "degC", "℃": "degC", "ºC": "degC", "°F": "degF", "ºF": "degF", "° C": "degC",
    "° F": "degF", "deg C": "degC", "deg F": "degF", "C": "degC", "F": "degF", "celsius": "degC",
    "fahrenheit": "degF", "µs": "us", "μs": "us", "µm": "um", "μm": "um", "µA": "uA", "μA": "uA",
    "µV": "uV", "μV": "uV", "%": "pct", "percent": "pct", "prozent": "pct", "°": "deg",
    "sec": "s", "msec": "ms", "seconds": "s", "sekunden": "s", "milliseconds": "ms",
    "minutes": "min", "hours": "h", "volt": "V", "volts": "V", "ampere": "A", "amps": "A",
    "newton": "N", "Nm": "N m", "mNm": "mN m", "N·m": "N m", "N*m": "N m",
    "N.m": "N m", "rev/min": "rpm", "PSI": "psi", "hPa": "mbar", "°/s": "deg/s", "r/min": "rpm",
    "1/min": "rpm", "°C/s": "K/s", "C/s": "K/s",
}  # fmt: skip
"""Other ways to write a unit of the table; words in small or capital letters."""


WITHOUT = ("-", "–")
"""What stands in place of a unit where there is none."""
_WORDS = ("in", "h", "min", "g", "psi", "1")
"""Units of the table that are words as well: a name that ends so, "flow_in", may mean these;
psi is the angle of yaw in "yaw_psi"."""
_ABBREVIATED: dict[str, str] = {
    "Nm": "N m", "J_K": "J/K", "W_K": "W/K", "K_W": "K/W", "W_m2K": "W/(m² K)",
    "N_m_A": "N m/A", "N_m_s": "N m s", "N_m_s_rad": "N m s/rad", "N_m_rad": "N m/rad",
    "N_s_m": "N s/m", "V_s_rad": "V s/rad", "N_A": "N/A", "J_kg": "J/kg", "kg_m2": "kg m²",
    "m_s2": "m/s²", "rad_s2": "rad/s²", "m3_s": "m³/s", "1_s": "1/s", "Hz": "Hz", "Ohm": "Ohm",
    "J": "J", "hPa": "mbar",
}  # fmt: skip
_ALL = {re.sub("[ /]", "_", unit): unit for unit in UNITS if unit not in _WORDS} | _ABBREVIATED
_ENDINGS = dict(sorted(_ALL.items(), key=lambda pair: -len(pair[0])))
"""How the name of a column or a parameter ends, after a "_", and its unit; longer ones first."""


_MORE = {
    "L": Unit("m3", 1e-3), "l": Unit("m3", 1e-3), "mL": Unit("m3", 1e-6), "ml": Unit("m3", 1e-6),
    "J": Unit("J", 1.0), "kJ": Unit("J", 1e3), "Wh": Unit("J", 3600.0),
    "Ah": Unit("A s", 3600.0), "mol": Unit("mol", 1.0), "m2": Unit("m2", 1.0),
    "m3": Unit("m3", 1.0), "Hz": UNITS["Hz"], "Ohm": UNITS["Ohm"],
}  # fmt: skip
"""Parts of compound units that are no units of the table, or no ends of names."""
_POWERS = {"": 1, "2": 2, "3": 3, "²": 2, "³": 3}
_SYMBOLS = {"m": "mass", "L": "length", "l": "length", "s": "length", "K": "", "V": "voltage"}
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
    return spelt(word) in UNITS or word.strip() in WITHOUT


@cache
def known(unit: str) -> Unit | None:
    """A unit of the table, or a product or quotient of such: "L/min", "W/(m² K)".

    Its base units are written with their powers: "m3 s-1". Temperatures in a compound are
    differences. None for what is neither.
    """
    if unit in UNITS:
        base = UNITS[unit]
        return Unit(_in_powers(_factors(base.si)), base.scale, base.offset)
    scale, powers = 1.0, list[tuple[str, int]]()
    for word, power in _factors(unit):
        of = _MORE.get(word) or UNITS.get(spelt(word))
        if of is None or not re.search("[ /]", unit):
            return None
        scale *= of.scale**power
        powers += [(name, power * count) for name, count in _factors(of.si)]
    return Unit(_in_powers(powers), scale)


def _factors(unit: str) -> Iterator[tuple[str, int]]:
    """The units in a product or quotient, each with its power."""
    for n, side in enumerate(unit.split("/")):
        for word in re.split(r"[ ·*()]+", side.strip(" ()")):
            name, power = word.rstrip("23²³"), word[len(word.rstrip("23²³")) :]
            yield name.rstrip("^"), (-1 if n else 1) * _POWERS.get(power, 1)


def _in_powers(factors: Iterable[tuple[str, int]]) -> str:
    powers: dict[str, int] = {}
    for name, power in factors:
        powers[name] = powers.get(name, 0) + power
    left = sorted((name, power) for name, power in powers.items() if power and name != "1")
    return " ".join(name if power == 1 else f"{name}{power}" for name, power in left) or "1"


def convertible(unit: str, to: str) -> bool:
    """Whether a value in `unit` can be converted to the unit `to`."""
    if unit == to:
        return True
    source, target = known(unit), known(to)
    return source is not None and target is not None and source.si == target.si


def units_for(unit: str) -> list[str]:
    """The units of the table that can be converted to `unit`, and itself."""
    return [*([] if unit in UNITS else [unit]), *(u for u in UNITS if convertible(u, unit))]


def alternatives(unit: str) -> str:
    """The units that can be converted to `unit`, with other ways to write them."""
    spellings = {u: [s for s, of in SPELLINGS.items() if of == u] for u in units_for(unit)}
    return ", ".join(f"{u} ({spellings[u][0]})" if spellings[u] else u for u in spellings)


def in_words(unit: str) -> str:
    """A unit as a person reads it, "°C/s" for "degC/s"; empty for numbers without one."""
    if unit == "1":
        return ""
    written = rf"{'|'.join(_READ)}|\bu(?=[msNAV]\b|Ohm)"
    return re.sub(written, lambda part: _READ.get(part[0], "µ"), unit)


def quantity(name: str, value: float) -> str:
    """A value as a person reads it, with the unit that its name ends with: `3 A` for `i_x_A`."""
    return f"{value:.10g} {in_words(unit_of(name))}".rstrip()


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


_MOST_DECIMALS, _LARGE = 5, 1e5
"""A number that needs more decimals, or is as large, is written with an exponent."""


def labelled(words: str, unit: str) -> str:
    """The label of an axis or a row: `temperature sensor of spring X, °C`."""
    return f"{words}, {in_words(unit)}".removesuffix(", ")


def with_sd(value: float, sd: float, sign: str = "") -> str:
    """A value and its standard deviation, both to the decimal of the deviation's first digit.

    Very large or small ones share an exponent: (5.50 ± 0.02)e-04. `sign` is that of a format.
    """
    if not 0.0 < sd < math.inf:
        return f"{value:{sign}.4g} ± {sd:.1g}"
    first_digit, size = _exponent(sd), max(abs(value), sd)
    exponent = 0 if -first_digit <= _MOST_DECIMALS and size < _LARGE else _exponent(size, 2)
    value, sd = value / 10.0**exponent, sd / 10.0**exponent
    decimals = max(0, exponent - first_digit)
    text = f"{value:{sign}z.{decimals}f} ± {sd:.{decimals}f}"
    return f"({text})e{exponent:+03d}" if exponent else text


def _exponent(value: float, decimals: int = 0) -> int:
    """The power of ten of a value's first digit, once it is rounded to so many more digits."""
    return int(f"{value:.{decimals}e}".partition("e")[2])


def with_unit(value: float, sd: float, unit: str) -> str:
    """A value with its standard deviation and unit."""
    return f"{with_sd(value, sd)} {in_words(unit)}".rstrip()


_READ = {
    "degC": "°C", "deg": "°", "Ohm": "Ω", "pct": "%", "permille": "‰", "A2s": "A² s"
}  # fmt: skip

NO_BREAK = "\u00a0"
_SHOWN = (*_ALL.values(), "min", "h", "g", "L", "floors", "MB")
_READ_UNITS = sorted({in_words(u) for u in _SHOWN}, reverse=True)
_VALUE = re.compile(
    rf"(?<=\d) (?:{'|'.join(re.escape(unit) for unit in _READ_UNITS)})(?![^\W_])"
    r"|(?<=\S) ± (?=\d)"
)


def unparted(text: str) -> str:
    """The text with no-break spaces in its values: `0.60 ± 0.01 s` stays in one line."""
    return _VALUE.sub(lambda value: value[0].replace(" ", NO_BREAK), text)
