"""Run logs to CSV, Parquet and MATLAB files, with the header beside the columns.

- CSV: one line of names (units are in them), then rows; empty where nothing was recorded. Header
  and events go to `<name>.header.json` beside it, so that the table stays a plain table.
- Parquet: header and events in the metadata of the schema, unit and legend in that of each column.
  Of more than `MOST_METADATA_BYTES` the `data` of events is left out, then the counters of the
  link, and a note says so: no program reads a file with much more.
- MATLAB (version 5): `run.columns.<channel>`, `run.units.<channel>`, `run.legends.<channel>`,
  `run.header`, `run.events`.

Channels of which nothing was recorded are left out, in all three. Of several axes each has a file
of its own, or all are in one table (`side_by_side`; not for MATLAB, whose names have no dot).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from smad.errors import RunLogError, refused_by_system
from smad.files import replacing, require_writable
from smad.runlog.header import header_of
from smad.runlog.reader import Column, Run, recorded
from smad.runlog.schema import LEGENDS, MISSING_INTEGER, channel_of

if TYPE_CHECKING:
    import pyarrow

METADATA_KEY = "smad"
MOST_METADATA_BYTES = 16_000_000
"""Far below the 90 MB that pyarrow refused to read back."""


def export_run(run: Run, target: str | Path, *, overwrite: bool = False) -> list[Path]:
    """Write `run` to `target` in the format its suffix names; returns the files written.

    Raises RunLogError for an unknown suffix, a file that is there already, an empty run, or a disk
    that refuses.
    """
    target = Path(target)
    write = WRITERS.get(target.suffix)
    if write is None:
        raise RunLogError(
            f"cannot export to {target.name}: unknown format",
            value=target.suffix or "no suffix",
            limit=" ".join(WRITERS),
            action="name a file with one of these suffixes",
        )
    if not len(run):
        raise RunLogError(f"{run.path} holds no rows", action="there is nothing to export")
    run = with_readable_metadata(run, target)
    files = [target, header_path(target)] if target.suffix == ".csv" else [target]
    taken = next((path for path in files if path.exists()), None)
    if taken is not None and not overwrite:
        raise RunLogError(f"{taken} is there already", action="use --overwrite or another name")
    for path in files:
        require_writable(path)
    cause, action = f"cannot write {target}", "check folder and space"
    with refused_by_system(RunLogError, cause, action=action), replacing(target) as partial:
        write(run, partial)
        if len(files) > 1:
            files[1].write_bytes(msgspec.json.format(header_document(run), indent=2) + b"\n")
    return files


def with_readable_metadata(run: Run, target: Path) -> Run:
    """Return `run` without what a file of that name cannot hold; its notes say what that is."""
    if target.suffix != ".parquet":
        return run
    bare = [msgspec.structs.replace(event, data={}) for event in run.events]
    parts: dict[str, dict[str, Any]] = {
        "the data of events": {"events": bare},
        "the counters of the link": {"link": []},
    }
    for name, less in parts.items():
        size = len(header_document(run))
        if size <= MOST_METADATA_BYTES:
            break
        note = (
            f"{name} left out of {target.name}: the metadata would have {size / 1e6:.0f} MB "
            f"of at most {MOST_METADATA_BYTES / 1e6:.0f} MB; the run log and CSV have all"
        )
        run = replace(run, notes=[*run.notes, note], **less)
    return run


def side_by_side(runs: Mapping[str, Run]) -> Run:
    """Return all axes of a log as one run, `NAME.channel` for each column.

    The rows are those of the axis with most of them, and `t_s` their times since the first. Beside
    each stands the last sample that every other axis had taken by then; its own board time says
    which that is.
    """
    base = max(runs.values(), key=len)
    columns: dict[str, Column] = {"t_s": base.unix_s - base.unix_s[:1].sum()}
    for name, run in runs.items():
        last = np.searchsorted(run.unix_s, base.unix_s, side="right") - 1
        for channel, column in run.columns.items():
            missing = np.nan if column.dtype.kind == "f" else MISSING_INTEGER
            latest = column[last] if len(column) else np.full(len(last), missing, column.dtype)
            columns[f"{name}.{channel}"] = np.where(last < 0, missing, latest)
    return replace(base, axis="", columns=columns)


def header_path(csv: Path) -> Path:
    """Where the header of an exported CSV is: `run.csv` → `run.header.json`."""
    return csv.with_suffix(".header.json")


def header_document(run: Run) -> bytes:
    """Header, units, events and notes of a run, as JSON."""
    return msgspec.json.encode(
        {
            "header": header_of(run.header, run.axis),
            "units": {name: channel_of(name).unit for name in _used(run)},
            "legends": legends(run),
            "events": run.events,
            "link": run.link,
            "notes": run.notes,
            "cut_short": run.cut_short,
            "exported_from": run.path.name,
        }
    )


def legends(run: Run) -> dict[str, Mapping[int, str]]:
    """Return what the numbers of each channel stand for that has words, where it was recorded."""
    channels = {name: channel_of(name).name for name in _used(run)}
    return {name: LEGENDS[channel] for name, channel in channels.items() if channel in LEGENDS}


def _used(run: Run) -> dict[str, Column]:
    return {name: column for name, column in run.columns.items() if recorded(column).any()}


def _arrow_table(run: Run) -> pyarrow.Table:
    import pyarrow as pa

    arrays, fields, words = [], [], legends(run)
    for name, column in _used(run).items():
        arrays.append(pa.array(column, mask=~recorded(column)))
        about = {"unit": channel_of(name).unit}
        if name in words:
            about["legend"] = msgspec.json.encode(words[name]).decode()
        fields.append(pa.field(name, arrays[-1].type, metadata=about))
    schema = pa.schema(fields, metadata={METADATA_KEY: header_document(run)})
    return pa.Table.from_arrays(arrays, schema=schema)


def _write_csv(run: Run, path: Path) -> None:
    from pyarrow import csv

    table = _arrow_table(run)
    with path.open("wb") as file:
        # The names by hand: pyarrow quotes them, which some readers then take as part of the name.
        file.write((",".join(table.column_names) + "\n").encode())
        csv.write_csv(table, file, csv.WriteOptions(include_header=False))


def _write_parquet(run: Run, path: Path) -> None:
    from pyarrow import parquet

    parquet.write_table(_arrow_table(run), str(path), compression="zstd")


def _write_mat(run: Run, path: Path) -> None:
    from scipy.io import savemat

    used = _used(run)
    document = msgspec.json.decode(header_document(run))
    header = {name: _matlab_value(value) for name, value in document["header"].items()}
    content = {
        "columns": {name: np.asarray(column).reshape(-1, 1) for name, column in used.items()},
        "units": {name: channel_of(name).unit for name in used},
        "legends": {name: _matlab_legend(words) for name, words in legends(run).items()},
        "header": header,
        "events": _matlab_json(document["events"]),
        "notes": "\n".join(document["notes"]),
    }
    with path.open("wb") as file:
        savemat(file, {"run": content}, long_field_names=True, oned_as="column")


def _matlab_legend(words: Mapping[int, str]) -> dict[str, Any]:
    # As `containers.Map(numbers, words)` takes them: a struct has no numbers for names.
    return {
        "numbers": np.array(list(words), np.float64),
        "words": np.array(list(words.values()), object),
    }


def _matlab_json(value: Any) -> str:
    # Other letters as \u escapes: Octave reads one byte a letter, and its jsondecode then fails.
    return json.dumps(value, separators=(",", ":"))


def _matlab_value(value: Any) -> Any:
    # Keys of tables are free text, which MATLAB does not take as names: JSON, for jsondecode.
    if isinstance(value, Mapping | list):
        return _matlab_json(value)
    return np.nan if value is None else value


WRITERS: Mapping[str, Callable[[Run, Path], None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".mat": _write_mat,
}
