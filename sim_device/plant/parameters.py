"""Parameter files: the one source of the plant's numbers, read, checked and held in SI."""

from __future__ import annotations

import functools
import hashlib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sim_device.plant.errors import ParameterError
from sim_device.plant.fields import FIELDS, ORDERINGS, Field
from sim_device.plant.textfile import TextFileError, beside, parsed, quoted
from sim_device.plant.units import UNITS

DATA = Path(__file__).parent / "data"
BUILT_IN = {"A": "set_a.toml", "B": "set_b.toml", "conserving": "conserving.toml"}
"""Files of the sets that `load_parameters` knows by name."""
STATUSES = ("published", "derived", "assumed")
_FIELDS = {field.name: field for field in FIELDS}
_KEYS = ("value", "unit", "status", "range", "source")
_LISTED = ", ".join(_KEYS)


@dataclass(frozen=True)
class Entry:
    """One parameter with its provenance. `value`, `low`, `high` are SI, in `unit`.

    `low` and `high` are the file's range: the bounds of a refit. `file_unit` is the unit the file
    uses, for tables and messages.
    """

    name: str
    symbol: str
    value: float
    unit: str
    low: float
    high: float
    status: str
    source: str
    file_unit: str
    meaning: str

    def shown(self, value: float | None = None) -> str:
        """The value (or another one, SI) in the file's unit, with the unit."""
        return _in_unit(self.value if value is None else value, self.file_unit)


@dataclass(frozen=True)
class ParameterSet:
    """All parameters of the plant, checked. Immutable: `replace` makes another one."""

    title: str
    entries: tuple[Entry, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return NAMES

    def entry(self, name: str) -> Entry:
        """The entry of that name. Raises ParameterError for a name that no set has."""
        try:
            return self.entries[_POSITION[name]]
        except KeyError:
            raise ParameterError(name, f"no such parameter; known are {', '.join(NAMES)}") from None

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def replace(self, /, **values: float) -> ParameterSet:
        """Another set with these values (SI).

        Only hard physical limits and orderings are checked, not the file's ranges: a refit may
        look beyond them. Raises ParameterError.
        """
        entries = list(self.entries)
        for name, value in values.items():
            entry = self.entry(name)
            number = _finite(name, value)
            if number == entry.value:
                continue
            field = _FIELDS[name]
            limits = field.low, field.high
            _within(name, number, limits, unit=entry.file_unit, limit="physical limit")
            entries[_POSITION[name]] = replace(entry, value=number)
        changed = ParameterSet(self.title, tuple(entries))
        _check_together(changed)
        return changed

    def digest(self) -> str:
        """SHA-256 of the names, values and units: what a log names as its parameter set."""
        text = "\n".join(f"{entry.name} {entry.value!r} {entry.unit}" for entry in self.entries)
        return hashlib.sha256(text.encode()).hexdigest()


def load_parameters(source: str | Path) -> ParameterSet:
    """Read a parameter file, or one of the built-in sets "A", "B" and "conserving".

    A file may start from another one with `extends = "other.toml"` (beside it or built in).
    Raises ParameterError, whose message starts with the entry's name, for anything missing,
    unknown, out of range, with a wrong unit, or out of order.
    """
    return _built_in(str(source)) if str(source) in BUILT_IN else _loaded(Path(source))


@functools.cache
def _built_in(name: str) -> ParameterSet:
    return _loaded(DATA / BUILT_IN[name])


def _loaded(path: Path) -> ParameterSet:
    title, raw = _read(path, seen=())
    missing = [name for name in NAMES if name not in raw]
    if missing:
        raise ParameterError(missing[0], f"missing in {path.name}; add a table with {_LISTED}")
    parameters = ParameterSet(title, tuple(_entry(_FIELDS[name], raw[name]) for name in NAMES))
    _check_together(parameters)
    return parameters


def parameters_text(parameters: ParameterSet, title: str | None = None) -> str:
    """A complete parameter file in the units of the set; `load_parameters` reads it back."""
    lines = [f"title = {quoted(parameters.title if title is None else title)}"]
    for entry in parameters.entries:
        unit = UNITS[entry.file_unit]
        low = min(entry.low, entry.value)
        high = max(entry.high, entry.value)
        lines += [
            "",
            f"[{entry.name}]",
            f"value = {unit.from_si(entry.value)!r}",
            f"unit = {quoted(entry.file_unit)}",
            f"status = {quoted(entry.status)}",
            f"range = [{unit.from_si(low)!r}, {unit.from_si(high)!r}]",
            f"source = {quoted(entry.source)}",
        ]
    return "\n".join(lines) + "\n"


NAMES: tuple[str, ...] = tuple(field.name for field in FIELDS)
_POSITION = {name: index for index, name in enumerate(NAMES)}


def _read(path: Path, seen: tuple[Path, ...]) -> tuple[str, dict[str, Any]]:
    try:
        raw = parsed(path, "TOML", tomllib.loads)
    except TextFileError as error:
        names = ", ".join(BUILT_IN)
        raise ParameterError("file", f"{path} {error}; give a file or one of {names}") from None
    resolved = path.resolve()
    if resolved in seen:
        raise ParameterError("extends", f"{path.name} extends itself; break the circle")
    title = raw.pop("title", path.stem)
    base = raw.pop("extends", None)
    unknown = [name for name in raw if name not in _FIELDS]
    if unknown:
        raise ParameterError(
            unknown[0], f"unknown entry in {path.name}; known are {', '.join(NAMES)}"
        )
    if base is not None:
        parent = beside(path, str(base)) or DATA / str(base)
        _, inherited = _read(parent, (*seen, resolved))
        raw = {**inherited, **raw}
    return str(title), raw


def _entry(field: Field, raw: object) -> Entry:
    name = field.name
    if not isinstance(raw, Mapping):
        raise ParameterError(name, f"is {raw!r}, not a table; write [{name}] with {_LISTED}")
    for key in [key for key in _KEYS if key not in raw]:
        raise ParameterError(name, f"has no '{key}'; an entry needs {_LISTED}")
    for key in sorted(set(raw) - set(_KEYS)):
        raise ParameterError(name, f"has an unknown key '{key}'; an entry has {_LISTED}")
    unit = UNITS.get(str(raw["unit"]))
    if unit is None or unit.si != field.unit:
        fitting = sorted(key for key, u in UNITS.items() if u.si == field.unit)
        raise ParameterError(
            name,
            f"unit {raw['unit']!r} is not a unit of {field.symbol}; use {' or '.join(fitting)}",
        )
    if raw["status"] not in STATUSES:
        raise ParameterError(name, f"status {raw['status']!r} is not one of {', '.join(STATUSES)}")
    if not isinstance(raw["source"], str) or not raw["source"].strip():
        raise ParameterError(name, f"source {raw['source']!r} is empty; say where it is from")
    bounds = raw["range"]
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise ParameterError(name, f"range {bounds!r} is not [low, high]")
    value = unit.to_si(_finite(name, raw["value"]))
    low, high = (unit.to_si(_finite(name, bound)) for bound in bounds)
    if low > high:
        raise ParameterError(name, f"range {bounds} is reversed; write [low, high]")
    file_unit, limits = str(raw["unit"]), (field.low, field.high)
    _within(name, low, limits, unit=file_unit, limit="physical limit (range)")
    _within(name, high, limits, unit=file_unit, limit="physical limit (range)")
    _within(name, value, (low, high), unit=file_unit, limit="range of the file")
    return Entry(
        name,
        field.symbol,
        value,
        field.unit,
        low,
        high,
        str(raw["status"]),
        raw["source"],
        file_unit,
        field.meaning,
    )


def _finite(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ParameterError(name, f"{value!r} is not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ParameterError(name, f"{number!r} is not finite; give a finite number")
    return number


def _in_unit(value: float, unit: str) -> str:
    """A value (SI) in `unit`, with the unit."""
    number = UNITS[unit].from_si(value)
    return f"{number:.6g}" if unit == "1" else f"{number:.6g} {unit}"


def _within(name: str, value: float, limits: tuple[float, float], *, unit: str, limit: str) -> None:
    """Raise ParameterError, in the file's unit, unless `value` is within `limits` (all SI)."""
    low, high = limits
    slack = 1e-12 * max(abs(low), abs(high))
    if not low - slack <= value <= high + slack:
        raise ParameterError(
            name,
            f"{_in_unit(value, unit)} is outside the {limit}, "
            f"{_in_unit(low, unit)} to {_in_unit(high, unit)}",
        )


def _check_together(parameters: ParameterSet) -> None:
    for small, large in ORDERINGS:
        low, high = parameters.entry(small), parameters.entry(large)
        if not low.value < high.value:
            raise ParameterError(
                small,
                f"{low.symbol} = {low.shown()} must be below {high.symbol} = {high.shown()}"
                f" ({large}); change one of them",
            )
    fraction = initial_detwinned(parameters)
    if not 0.0 <= fraction <= 1.0:
        raise ParameterError(
            "initial_force",
            f"Eq. (10) gives ξ_S0 = {fraction:.4g}, outside 0 to 1: δ0 ="
            f" {parameters.entry('initial_deflection').shown()} and F0 ="
            f" {parameters.entry('initial_force').shown()} do not fit the moduli",
        )


def initial_detwinned(parameters: ParameterSet, tension_N: float | None = None) -> float:
    """ξ_S0 of the pair under a tension, by default that of its mounting, paper Eq. (10).

    Meaningful from 0 to 1.
    """
    tension = parameters["initial_force"] if tension_N is None else tension_N
    slack = parameters["initial_deflection"] - tension / martensite_stiffness(parameters)
    return slack / parameters["max_deflection"]


def martensite_stiffness(parameters: ParameterSet) -> float:
    """Stiffness of a spring of martensite, N/m: C2 G_M/C1."""
    c1, c2 = spring_factors(parameters)
    return c2 * parameters["modulus_martensite"] / c1


def spring_factors(parameters: ParameterSet) -> tuple[float, float]:
    """(C1, C2) of paper Eqs (2), (3): τ = C1 F in Pa/N, γ = C2 δ in 1/m, with the Wahl factor."""
    wire = parameters["wire_diameter"]
    coil = parameters["coil_diameter"]
    index = coil / wire
    wahl = (4.0 * index - 1.0) / (4.0 * index - 4.0) + 0.615 / index
    c1 = 8.0 * wahl * coil / (math.pi * wire * wire * wire)
    c2 = wire / (math.pi * parameters["coils"] * coil * coil)
    return c1, c2
