"""The channels of a run log in a table that was made elsewhere, in the units of the schema."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from smad.arrays import Array
from smad.config.toml_file import read_toml
from smad.errors import LogImportError
from smad.records.column_names import Assignment, ColumnRule, assign, is_time
from smad.records.csv_table import CsvFormat
from smad.records.tables import ForeignTable, is_rounded, open_table
from smad.records.units import Written, convert
from smad.runlog.bounds import Together
from smad.runlog.schema import CHANNELS

RANGES: Mapping[str, tuple[float, float]] = {
    "i_cmd": (0.0, 4.0), "i_applied": (0.0, 4.0), "duty": (0.0, 1.0), "i_meas": (-1.0, 6.0),
    "v": (-1.0, 15.0), "rtd": (-20.0, 120.0), "displacement": (-25.0, 25.0), "force": (-1.0, 12.0),
}  # fmt: skip
"""Lowest and highest value that channels of the spring pair can have, by how their names begin."""


APPLIED = ("i_cmd", "i_applied", "duty", "drain")
"""How the names of inputs begin."""
LONGEST_STEP_S = 1.0
"""A pair that is sampled slower shows nothing of how it moves."""


class MappingFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mapping file (TOML): `[csv]`, and `[columns."name in the file"]` with a rule each.

    The inputs of a row are in force in the interval that ends at its time, or begins there where
    they act `after` it.
    """

    csv: CsvFormat = CsvFormat()
    columns: dict[str, ColumnRule] = {}
    inputs_act: Literal["before", "after"] = "before"


_NO_MAPPING = MappingFile()


def read_mapping(path: str | Path) -> MappingFile:
    """The mapping file at `path`. Raises LogImportError when it cannot be read or understood."""
    action = "smad docs guide/run-logs shows a mapping file"
    return read_toml(Path(path), MappingFile, "mapping", LogImportError, action)


@dataclass(frozen=True)
class Channels:
    """Channels, missing samples NaN, which column each is, and in words what was not read.

    `written` says of each how it stands in the file.
    """

    columns: dict[str, Array]
    written: dict[str, Written]
    assignment: Assignment
    notes: tuple[str, ...]


def read_channels(
    path: Path, together: Together | None = None, mapping: MappingFile | None = None
) -> Channels:
    """Channels of the table of one run, which may hold no more than a run can.

    `mapping` says how it is written. `together` counts the runs that are held at once. Raises
    LogImportError for a file that cannot be used, RunLogError for one too many.
    """
    mapping = mapping or MappingFile()
    table = open_table(path, mapping.csv)
    if together is not None:
        together.take(path, rows=table.most_rows, columns=min(len(table.names), len(CHANNELS)))
    return channels_of(table, mapping)


def channels_of(table: ForeignTable, mapping: MappingFile = _NO_MAPPING) -> Channels:
    """Channels of a table. Raises LogImportError for one that cannot be used."""
    rules = mapping.columns
    column_rules = {**_time_of_stamps(table, rules), **rules}
    for name in (n for n in column_rules if n in table.stamps and not table.stamps[n]):
        if column_rules[name].column_unit not in ("", "s"):
            raise LogImportError(
                f"{table.path}: column {name!r} holds stamps, which are read in s",
                value=column_rules[name].column_unit,
                action="leave column_unit out of the mapping file",
            )
        column_rules[name] = msgspec.structs.replace(column_rules[name], column_unit="s")
    unused = [n for n in table.stamps if n not in column_rules]
    assignment = assign([n for n in table.names if n not in unused], column_rules)
    assignment.ignored.extend(unused)
    columns = _converted(table, assignment, rules)
    _check_time(table, assignment, columns)
    if mapping.inputs_act == "after":
        applied = [n for n in columns if n.startswith(APPLIED)]
        columns |= {n: np.r_[columns[n][:1], columns[n][:-1]] for n in applied}
    written = {
        rule.channel: Written.of(
            rule.column_unit, CHANNELS[rule.channel].unit, rule.scale, rule.offset
        )
        for rule in assignment.rules.values()
    }
    stamps = [n for n in column_rules if n in table.stamps]
    times = [f"the time is column {n!r}, in s since its first stamp" for n in stamps]
    return Channels(columns, written, assignment, (*table.notes, *times))


def _time_of_stamps(table: ForeignTable, rules: Mapping[str, ColumnRule]) -> dict[str, ColumnRule]:
    """The rule by which the first column of stamps is the time, where no other column is."""
    stamps = [n for n, advice in table.stamps.items() if not advice and n not in rules]
    timed = any(is_time(n) for n in table.names if n not in table.stamps)
    if not stamps or timed or any(rule.channel == "t_s" for rule in rules.values()):
        return {}
    return {stamps[0]: ColumnRule("t_s", "s")}


def hold_last_value(column: Array) -> Array:
    """The column, shape (n,), with each number in force until the next; NaN before the first."""
    finite = np.isfinite(column)
    last = np.maximum.accumulate(np.where(finite, np.arange(len(column)), -1))
    return np.where(last < 0, np.nan, column[last])


def _converted(
    table: ForeignTable, assignment: Assignment, rules: Mapping[str, ColumnRule]
) -> dict[str, Array]:
    columns = {}
    if "t_s" not in {rule.channel for rule in assignment.rules.values()}:
        raise LogImportError(
            f"{table.path} has no time column",
            value=", ".join(table.names),
            limit="t_s, time_s, time_ms …",
            action=next(iter(table.stamps.values()), "")
            or "name the column time_s, or use a mapping file",
        )
    for name, values in table.columns(assignment.rules):
        rule = assignment.rules[name]
        channel = CHANNELS[rule.channel]
        converted = convert(values * rule.scale + rule.offset, rule.column_unit, channel.unit)
        if rule.channel != "t_s":
            converted = np.where(np.isinf(converted), np.nan, converted)
        if rule.hold:
            converted = hold_last_value(converted)
        most = np.nanmax(converted, initial=0.0)
        if rule.column_unit == "pct" and name not in rules and 0.0 < most <= 0.01:
            raise LogImportError(
                f"{table.path}: column {name!r} is named %, and never above 1 %",
                value=f"at most {100.0 * most:.3g}",
                limit="0 to 100 %",
                action="a fraction? name it without a unit, or give its unit in a mapping file",
            )
        if channel.kind == "integer":
            bad = np.flatnonzero((converted < 0) | (converted != np.rint(converted)))
            bad = bad[~np.isnan(converted[bad])]
            if len(bad):
                raise LogImportError(
                    f"{table.path}, {table.place_of(int(bad[0]))}: column {name!r} holds "
                    "counts or bits",
                    value=float(converted[bad[0]]),
                    limit="whole numbers from 0",
                    action="correct the value",
                )
        columns[rule.channel] = converted
    return {name: columns[name] for name in CHANNELS if name in columns}


def _check_time(table: ForeignTable, assignment: Assignment, columns: Mapping[str, Array]) -> None:
    t_s = columns["t_s"]
    name = next(n for n, rule in assignment.rules.items() if rule.channel == "t_s")
    untimed = np.flatnonzero(~np.isfinite(t_s))
    if len(untimed):
        row = int(untimed[0])
        raise LogImportError(
            f"{table.path}, {table.place_of(row)}: time column {name!r} holds "
            + ("no number" if np.isnan(t_s[row]) else f"{t_s[row]:g}"),
            action="fill it, or remove the row",
        )
    back = np.flatnonzero(np.diff(t_s) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise LogImportError(
            f"{table.path}, {table.place_of(row)}: time does not increase",
            value=f"{t_s[row]:.9g} s after {t_s[row - 1]:.9g} s",
            action="write it with more digits"
            if is_rounded(t_s)
            else "sort the rows, and remove repeated ones",
        )
