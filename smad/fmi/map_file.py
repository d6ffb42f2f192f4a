"""The map file (TOML): which column of a run is which variable of a unit, and what may be wrong."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from smad.config.toml_file import read_toml
from smad.fmi.errors import FmiError
from smad.fmi.unit_file import UnitFile
from smad.records.units import Written
from smad.simulators.by_map import ColumnMap, ColumnRow, Held, ModelParameterRow, Number, Positive
from smad.units import known, spelt

_FROM_RECORDS = math.nan


class _ColumnRow(ColumnRow, frozen=True, kw_only=True):
    """What is left out is NaN; the records have it."""

    variable: str
    unit: str
    low: Number = _FROM_RECORDS
    high: Number = _FROM_RECORDS

    @property
    def ranged(self) -> bool:
        """Whether the map has a range."""
        return not math.isnan(self.low)


class InputRow(_ColumnRow, frozen=True, kw_only=True):
    """An input: value of the unit = `scale` · column + `offset`; the range is that of the value.

    `held`: its rows were in force *until* their time or *from* it on; empty: as the map's `held`.
    """

    held: Held | Literal[""] = ""

    def written(self, name: str) -> Written:
        """As of any column, but the value is that of the unit."""
        read = super().written(name)
        offset = self.scale * read.offset + self.offset
        return replace(read, scale=self.scale * read.scale, offset=offset)


class ChannelRow(_ColumnRow, frozen=True, kw_only=True):
    """A measured channel: column = `scale` · value of the unit + `offset`; the range is its own."""

    quantum: Positive = _FROM_RECORDS
    noise: Positive = _FROM_RECORDS


class ParameterRow(ModelParameterRow, frozen=True, kw_only=True):
    """A parameter of the unit that the refit may move."""

    variable: str
    unit: str


class TermRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A term that the unit adds by way of the input `variable`: size · f((of − zero) / span).

    `of`: an input or channel of the map, as the unit has it; empty for a constant. `shape` is f:
    the `power`, which keeps the sign; the *sign*, tanh(x), as dry friction goes with a velocity; or
    the *deadband*, 0 within ±1 and x ∓ 1 beyond. `span` is 1 if left out, of a *sign* a hundredth
    of the range of `of`. `place`: where in the unit that is, in words; empty: the input of the map
    that drives the variable, or the variable.
    """

    variable: str
    unit: str
    low: Number
    high: Number
    title: str
    place: str = ""
    typical: Number
    of: str = ""
    zero: Number = 0.0
    span: Positive = _FROM_RECORDS
    power: Annotated[float, msgspec.Meta(gt=0, le=8)] = 1.0
    shape: Literal["power", "sign", "deadband"] = "power"

    @property
    def width(self) -> float:
        """The span, 1 where none is given."""
        return 1.0 if math.isnan(self.span) else self.span

    def shaped(self, x: Any) -> Any:
        """f((x − zero) / span)."""
        x = (x - self.zero) / self.width
        if self.shape == "sign":
            return np.tanh(x)
        if self.shape == "deadband":
            return x - np.clip(x, -1.0, 1.0)
        return x if self.power == 1.0 else np.sign(x) * np.abs(x) ** self.power


class Map(ColumnMap, frozen=True, kw_only=True):
    """A map file. `lag_s`: what a sensor or a drive of such a plant may well lag by; left out, NaN:
    as the records have it.

    `start`: variables set before each run, by name in the unit: a number, or the name of a channel
    whose reading there it is (CHANNEL_rate: its rate). `window_s`: runs are replayed in windows
    that begin so; 0: whole; left out: chosen, where the start is of channels. `shortest_s`: how
    long a run must be.
    """

    lag_s: Positive = _FROM_RECORDS
    inputs: dict[str, InputRow]
    channels: dict[str, ChannelRow]
    parameters: dict[str, ParameterRow]
    terms: dict[str, TermRow] = msgspec.field(default_factory=dict)
    start: dict[str, Number | str] = msgspec.field(default_factory=dict)
    window_s: Annotated[float, msgspec.Meta(ge=0, le=1e15)] | None = None
    time: str = "t_s"
    shortest_s: Positive = 8.0


def read_map(path: Path) -> Map:
    """Read a map file. Raises FmiError for a file that cannot be read, and by the key's name."""
    mapped = read_toml(path, Map, "map file", FmiError, "docs/guide/fmi.md shows a map file")
    _check(path, mapped)
    return mapped


def _check(path: Path, mapped: Map) -> None:
    tables = _tables(mapped)
    for table in ("inputs", "channels", "parameters"):
        if not tables[table]:
            raise FmiError(f"map file {path} has no {table}", action=f"add [{table}.NAME]")
    twins = sorted(set(mapped.inputs) & set(mapped.channels))
    if twins:
        raise FmiError(f"map file {path} has {twins[0]} as input and as channel", action="name one")
    for table, rows in tables.items():
        for name, row in rows.items():
            left_out = math.isnan(row.low) and math.isnan(row.high)
            if not left_out and not row.low < row.high:
                raise FmiError(
                    f"map file {path}, {table}.{name} has no range",
                    value=f"{row.low:g} to {row.high:g}",
                    limit="low < high",
                    action="correct it",
                )
    for name, term in mapped.terms.items():
        if term.of and term.of not in {**mapped.inputs, **mapped.channels}:
            raise FmiError(
                f"map file {path}, terms.{name}.of is neither an input nor a channel of the map",
                value=term.of,
                limit=", ".join([*mapped.inputs, *mapped.channels]),
                action="correct it",
            )
        if term.power != 1.0 and term.shape != "power":
            raise FmiError(
                f"map file {path}, terms.{name} has a power and another shape", action="give one"
            )
        if not term.low <= 0.0 <= term.high or not term.typical:
            raise FmiError(
                f"map file {path}, terms.{name} must allow 0 and be typically something else",
                value=f"{term.low:g} to {term.high:g}, typically {term.typical:g}",
                action="correct it",
            )

    for variable, start in mapped.start.items():
        if isinstance(start, str) and start.removesuffix("_rate") not in mapped.channels:
            raise FmiError(
                f"map file {path}, start.{variable} is not a channel of the map",
                value=start,
                limit=", ".join([*mapped.channels, *(f"{c}_rate" for c in mapped.channels)]),
                action="correct it, or give a number",
            )
    if mapped.window_s and not any(isinstance(v, str) for v in mapped.start.values()):
        raise FmiError(
            f"map file {path} sets window_s, but no [start]",
            value=f"window_s = {mapped.window_s:g}",
            action="give [start] the channels that the unit begins from",
        )


_ROLES: Mapping[str, tuple[str, ...]] = {
    "inputs": ("input",),
    "channels": ("output", "local"),
    "parameters": ("parameter",),
    "terms": ("input",),
}
"""The tables of a map, and which causalities the variables of each may have."""


def _tables(mapped: Map) -> dict[str, Mapping[str, Any]]:
    return {table: getattr(mapped, table) for table in _ROLES}


def require_fit(mapped: Map, unit: UnitFile) -> None:
    """Check each variable of a map against a unit: there, a real one, of the role and the unit.

    Raises FmiError.
    """
    for table, rows in _tables(mapped).items():
        for name, row in rows.items():
            _require(unit, f"{table}.{name}", row.variable, _ROLES[table])
            _require_unit(unit, f"{table}.{name}", row)
    for variable in mapped.start:
        _require(unit, f"start.{variable}", variable, ("parameter", "input", "local", "output"))


def _require(unit: UnitFile, key: str, variable: str, roles: tuple[str, ...]) -> None:
    listed = unit.variables
    if variable not in listed:
        near = difflib.get_close_matches(variable, listed, n=3)
        raise FmiError(
            f"{unit.path.name} has no variable {variable}, which the map has at {key}",
            limit=", ".join(near) or ", ".join([n for n in listed if listed[n].causality in roles]),
            action="correct the map",
        )
    about = listed[variable]
    if about.type != "Real":
        raise FmiError(f"{key}: {variable} is not of type Real", value=about.type, limit="Real")
    if about.causality not in roles:
        raise FmiError(
            f"{key}: {variable} has another causality in {unit.path.name}",
            value=about.causality,
            limit=" or ".join(roles),
            action="name another variable, or change its causality in the unit",
        )


def _require_unit(unit: UnitFile, key: str, row: Any) -> None:
    about = unit.variables[row.variable]
    # A declared type has the unit of its variables; FMI multiplies units by a point, "N.m".
    has = spelt(about.unit or getattr(about.declaredType, "unit", None) or "")
    converted = isinstance(row, ColumnRow) and not row.plain
    given, of_unit = spelt(row.unit), known(has.replace(".", " "))
    same = has == given or (of_unit is not None and of_unit == known(given.replace(".", " ")))
    if converted or isinstance(row, TermRow) or has in {"", "1"} or same:
        return
    of_column = ": a column whose name ends with another is converted; or give scale and offset"
    raise FmiError(
        f"{key}: {row.variable} is in another unit in {unit.path.name}",
        value=row.unit,
        limit=has,
        action=f"use that unit{of_column if isinstance(row, ColumnRow) else ''}",
    )
