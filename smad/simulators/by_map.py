"""Runs by a map (TOML): which column is what of a unit of FMI or of a MuJoCo model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from smad.diagnosis.plant import Parameter
from smad.records.channels import hold_last_value
from smad.records.column_names import unit_in
from smad.records.csv_table import CsvFormat
from smad.records.readings import on_lines
from smad.records.tables import left_out
from smad.records.units import Written, converts
from smad.simulators.columns import Table, tables_of
from smad.simulators.declare import PRIOR_OF_RANGE
from smad.simulators.errors import SimulatorError
from smad.units import alternatives, convertible, spelt

Number = Annotated[float, msgspec.Meta(ge=-1e15, le=1e15)]
Positive = Annotated[float, msgspec.Meta(gt=0, le=1e15)]
Held = Literal["until", "from"]


class ColumnRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A column of the runs: `unit` is that of its values, `column` its name in a run and
    `column_unit` its unit there, where these are others.

    With `hold` rows may have no number: an input then keeps its last one, and a channel is read on
    the straight line between its numbers.
    """

    unit: str = ""
    column: str = ""
    column_unit: str = ""
    hold: bool = False
    scale: Number = 1.0
    offset: Number = 0.0

    @property
    def plain(self) -> bool:
        """Whether the row converts no unit by its scale and offset."""
        return not converts(self.scale, self.offset)

    def written(self, name: str) -> Written:
        """How the column `name` stands in its file: in `column_unit`, or as its name there ends.

        Raises SimulatorError for units of two quantities, unless the row says how to convert them.
        """
        stated, named = spelt(self.column_unit), unit_in(self.column or name)
        target = spelt(self.unit) or unit_in(name)
        # A name may well end as a unit does, where the map says another one.
        named = named if self.plain and (not self.unit or convertible(named, target)) else ""
        unit = stated or named
        if not target or not unit or target == unit:
            return Written()
        if not convertible(unit, target):
            raise SimulatorError(
                f"the map gives {name} a column in another unit",
                value=self.column_unit or self.column,
                limit=alternatives(target),
                action="name it by its unit, or give scale and offset",
            )
        return Written.of(unit, target)


class ModelParameterRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A parameter that the refit may move; without `nominal` it begins where the model has it."""

    low: Number
    high: Number
    nominal: Number | None = None
    prior_sd: Positive | None = None

    def declared(self, name: str, unit: str, of_model: float | None) -> Parameter:
        """With what is left out: the model's own value, a sixth of the range."""
        nominal = of_model if self.nominal is None else self.nominal
        if nominal is None or not self.low < self.high or not self.low <= nominal <= self.high:
            raise SimulatorError(
                f"parameters.{name} does not begin within its range",
                value="nothing" if nominal is None else nominal,
                limit=f"{self.low:g} to {self.high:g} {unit}",
                action="give nominal, or another range, in the map",
            )
        return Parameter(
            name=name,
            unit=unit,
            nominal=nominal,
            low=self.low,
            high=self.high,
            prior_sd=self.prior_sd or PRIOR_OF_RANGE * (self.high - self.low),
        )


class ColumnMap(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every map has. `held`: a row's inputs were in force *until* its time, as a run log has
    them, or *from* it on. `time`: its column, in `time_unit`, else in the unit that its name ends
    with, else in s. `csv`: how a CSV file is written."""

    name: str = ""
    held: Held = "until"
    time: str = ""
    time_unit: Literal["", "s", "ms", "us", "ns", "min", "h"] = ""
    csv: CsvFormat = CsvFormat()


def tables_by_map(
    groups: Iterable[Any],
    mapped: ColumnMap,
    inputs: Mapping[str, ColumnRow],
    channels: Mapping[str, ColumnRow],
    *,
    observed: Sequence[str] = (),
    measured: bool = True,
) -> list[list[Table]]:
    """The runs of each group by the columns that a map names, by its own names and in its units.

    Raises SimulatorError for a run without an input or, where `measured`, without any channel.
    """

    def by_map(table: Table) -> Table:
        rows = {**inputs, **channels}
        names = {row.column or name for name, row in rows.items()} | set(observed)
        if unread := [why for n, why in table.unread.items() if n in names]:
            raise SimulatorError(unread[0])
        sources = {n: row.column or n for n, row in rows.items()}
        given = {n: table.columns[c] for n, c in sources.items() if c in table.columns}
        written = {n: rows[n].written(n) for n, c in given.items() if np.isfinite(c).any()}
        columns = {n: w.values(given[n]) for n, w in written.items()}
        lacking = [n for n in inputs if n not in columns]
        if measured and not columns.keys() & channels.keys():
            lacking += channels
        if lacking:
            raise SimulatorError(
                f"{table.name} has no column {sources[lacking[0]]!r}, which the map names",
                limit=", ".join(table.columns),
                action="correct the map, or leave the run out",
            )
        for name in (n for n in columns if rows[n].hold):
            columns[name] = (hold_last_value if name in inputs else on_lines)(columns[name])
        columns |= {n: table.columns[n] for n in observed if n in table.columns}
        unused = [n for n in table.columns if n not in names]
        by_name = [n for n in written if not (rows[n].column or rows[n].column_unit)]
        units = {n: unit for n in by_name if (unit := written[n].unit)}
        read = [f"{n} is read in {unit}, as its name ends" for n, unit in units.items()]
        notes = (*table.notes, *left_out(unused, ", which the map does not name"), *read)
        return replace(table, columns=columns, notes=notes, written=written)

    return [
        [by_map(t) for t in tables_of(group, mapped.time, mapped.csv, mapped.time_unit)]
        for group in groups
    ]
