"""Logs made elsewhere become run logs, with `source = "import"` in the header."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from smad.arrays import Array
from smad.errors import LogImportError
from smad.records.channels import (
    APPLIED,
    LONGEST_STEP_S,
    RANGES,
    Channels,
    MappingFile,
    channels_of,
)
from smad.records.column_names import Assignment
from smad.records.declared import Declared
from smad.records.readings import beyond_range, checked, checked_columns, doubted_step
from smad.records.tables import open_table
from smad.records.units import Written
from smad.runlog.export import METADATA_KEY, header_path
from smad.runlog.header import RunHeader
from smad.runlog.holes import holes_in, words
from smad.runlog.schema import CHANNELS, Event, LinkSample, Record, Row
from smad.runlog.writer import require_new, write_run

_ROWS_AT_ONCE = 10_000
_PLAUSIBLE = {
    "A": (-50.0, 50.0), "V": (-100.0, 100.0), "degC": (-60.0, 400.0), "1": (0.0, 1.0),
    "mm": (-500.0, 500.0), "N": (-500.0, 500.0),
}  # fmt: skip
"""What any bench of this kind can show, by unit; `RANGES` is what ours can."""


@dataclass(frozen=True)
class Imported:
    """What an import made: the log, which column became which channel, and what was left out."""

    path: Path
    rows: int
    channel_of: dict[str, str]
    ignored: list[str]
    missing: list[str]
    notes: list[str]

    def lines(self) -> list[str]:
        """What was left out, what is not in the file, and the notes."""
        named = {"left out": self.ignored, "not in the file": self.missing}
        lines = [f"{what}: {', '.join(names)}" for what, names in named.items() if names]
        return [*lines, *(f"note: {note}" for note in self.notes)]


class _Beside(msgspec.Struct):
    # What `export` writes beside a CSV, into Parquet; see smad.runlog.export.header_document.
    header: RunHeader = RunHeader()
    events: list[Event] = []
    link: list[LinkSample] = []


def import_table(
    source: str | Path, target: str | Path, mapping: MappingFile | None = None
) -> Imported:
    """Turn the table at `source` into a run log at `target`.

    A header that `smad log export` left beside or in it is taken over. Channels that the file does
    not have are absent from the log and listed in the result.

    Raises LogImportError for a file that cannot be used, RunLogError for a target that cannot be
    written.
    """
    source, target = Path(source), Path(target)
    require_new(target)
    mapping = mapping or MappingFile()
    named = channels_of(open_table(source, mapping.csv), mapping)
    assignment = named.assignment
    if set(named.columns) <= {"t_s", "host_time_s"}:
        raise LogImportError(
            f"{source} has no column that is a channel",
            value=", ".join(assignment.ignored) or "its times alone",
            action="end names with a unit (force_N, T_x_K), or use a mapping file",
        )
    columns, notes = _plausible(source, named)
    beside = _read_beside(source)
    header = _header(source, beside.header, assignment, columns)
    records = _records(columns, beside)
    write_run(target, header, records)
    return Imported(
        path=target,
        rows=len(columns["t_s"]),
        channel_of={name: rule.channel for name, rule in assignment.rules.items()},
        ignored=[name or "one without a name" for name in assignment.ignored],
        missing=[name for name in CHANNELS if name not in columns],
        notes=[*named.notes, *words(holes_in(columns["t_s"].tolist())), *notes],
    )


def _plausible(source: Path, named: Channels) -> tuple[dict[str, Array], list[str]]:
    """The columns without what is no reading, and what was left out in words.

    Raises LogImportError for a column that cannot be in its unit.
    """
    columns = named.columns
    declared = {d.name: d for name in columns if (d := _declared(name, named, of_ours=True))}
    driven = any(d.applied for d in declared.values())
    # Without a recorded input, a reading may jump with one.
    steady = None if driven else np.zeros(len(columns["t_s"]), dtype=bool)
    t_s, notes = columns["t_s"], []
    for name, ours in declared.items():
        wide = _declared(name, named, of_ours=False)
        if wide is None or not beyond_range(columns[name], ours):
            continue
        if not beyond_range(columns[name], wide):
            declared[name] = wide
            text = checked(columns[name], ours, t_s, steady).refusal
            notes.append(f"{text}; imported so, but no diagnosis takes it")
    checkable = {name: columns[name] for name in declared}
    readings, remarks = checked_columns(checkable, list(declared.values()), t_s, steady)
    for remark in remarks:
        if remark.kind == "out of range":
            raise LogImportError(f"{source}: {remark.text}")
        if remark.kind != "empty":
            emptied = "; left empty" if remark.kind == "no reading" else ""
            notes.append(
                f"{remark.text}: {remark.advice}" if remark.advice else remark.text + emptied
            )
    if text := doubted_step(t_s, LONGEST_STEP_S):
        notes.append(f"{text}; imported so, but no diagnosis takes it")
    return {**columns, **readings}, notes


def _declared(name: str, named: Channels, *, of_ours: bool) -> Declared | None:
    """What a channel can be, of our bench or of any; None where nothing is known."""
    unit, kind = CHANNELS[name].unit, CHANNELS[name].kind
    ours = next((r for begin, r in RANGES.items() if name.startswith(f"{begin}_")), None)
    ends = (ours if of_ours else None) or _PLAUSIBLE.get(unit)
    if ends is None or kind != "float":
        return None
    applied = name.startswith(APPLIED)
    return Declared(
        name=name,
        unit=unit,
        low=ends[0],
        high=ends[1],
        applied=applied,
        written=named.written.get(name, Written()),
    )


def _read_beside(source: Path) -> _Beside:
    embedded = _in_schema(source)
    path = source if embedded else header_path(source)
    try:
        return msgspec.json.decode(embedded or path.read_bytes(), type=_Beside)
    except FileNotFoundError:
        return _Beside()
    except OSError as error:
        raise LogImportError(
            f"cannot read {path}: {error.strerror}", action="move it away or make it readable"
        ) from error
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise LogImportError(
            f"{path} is not the header of an exported log: {error}",
            action=f"move it away; {source.name} can be imported without"
            if not embedded
            else f"write the file without the metadata {METADATA_KEY!r}",
        ) from None


def _in_schema(source: Path) -> bytes:
    """What an export wrote into the metadata of a Parquet file."""
    if not source.name.lower().endswith(".parquet"):
        return b""
    from pyarrow import parquet

    header: bytes = (parquet.read_schema(source).metadata or {}).get(METADATA_KEY.encode(), b"")
    return header


def _header(
    source: Path,
    beside: RunHeader,
    assignment: Assignment,
    columns: Mapping[str, Array],
) -> RunHeader:
    t_s = columns["t_s"]
    changes: dict[str, Any] = {
        "source": "import",
        "name": beside.name or source.stem,
        "axes": (),
        "extra": {
            **beside.extra,
            "imported_from": source.name,
            "imported_source": beside.source,
            "imported_columns": msgspec.json.encode(
                {
                    name: f"{rule.channel} from {rule.column_unit}"
                    for name, rule in assignment.rules.items()
                }
            ).decode(),
            "ignored_columns": ", ".join(assignment.ignored),
        },
    }
    if beside.rate_hz is None and len(t_s) > 1:
        changes["rate_hz"] = round(float(1.0 / np.median(np.diff(t_s))), 6)
    host_time_s = columns.get("host_time_s")
    if not beside.started_unix_s and host_time_s is not None and np.isfinite(host_time_s[0]):
        changes["started_unix_s"] = float(host_time_s[0])
    return msgspec.structs.replace(beside, **changes)


def _records(columns: Mapping[str, Array], beside: _Beside) -> Iterator[Record]:
    names = list(columns)
    for start in range(0, len(columns["t_s"]), _ROWS_AT_ONCE):
        part = slice(start, start + _ROWS_AT_ONCE)
        # As Python's numbers the whole table would take several times its size.
        lists = [_plain_list(name, column[part]) for name, column in columns.items()]
        for values in zip(*lists, strict=True):
            yield Row(**dict(zip(names, values, strict=True)))
    yield from beside.events
    yield from beside.link


def _plain_list(name: str, column: Array) -> list[Any]:
    values: list[float] = column.tolist()
    if CHANNELS[name].kind == "float":
        return values
    return [None if np.isnan(value) else int(value) for value in values]
