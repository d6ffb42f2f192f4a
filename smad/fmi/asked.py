"""Runs of any plant by a map, and the diagnosis of a unit with them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from smad.diagnosis import Answer, diagnose
from smad.diagnosis.runs import GapRun, bridged
from smad.fmi.errors import FmiError
from smad.fmi.map_file import ChannelRow, InputRow, Map, read_map
from smad.fmi.plant import FmuPlant
from smad.fmi.unit_file import open_unit
from smad.runlog.bounds import require_bounded
from smad.runlog.reader import read_run, recorded
from smad.runlog.tables import KINDS, open_table
from smad.simulators.rating import Rating, rate
from smad.simulators.windows import choose_window


def diagnose_unit(
    fmu: Path,
    map_path: Path,
    runs: Sequence[Path],
    *,
    good: Sequence[Path] = (),
    hold_out: Sequence[Path] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Answer:
    """Where a unit and the runs disagree; as `smad.diagnosis.diagnose`.

    Raises FmiError for a unit or a map that cannot be used, RunLogError for a run that cannot.
    """
    mapped = read_map(map_path)
    with contextlib.closing(FmuPlant(open_unit(fmu), mapped)) as plant:
        progress("reading")
        asked, known, held = (
            [read_mapped(path, mapped) for path in paths] for paths in (runs, good, hold_out)
        )
        plant.window_s, why = 0.0, ""
        if any(isinstance(v, str) for v in mapped.start.values()):
            plant.window_s, why = choose_window(plant, asked, mapped.window_s)
        answer = diagnose(asked, plant=plant, good=known, hold_out=held, progress=progress)
        notes = [*answer.verdict.notes, *([why] if why else [])]
        return replace(answer, verdict=msgspec.structs.replace(answer.verdict, notes=notes))


def plan_unit(
    fmu: Path, map_path: Path, inputs: Sequence[Path], *, within_s: float = 5.0
) -> list[Rating]:
    """What runs with these inputs would show of a unit; see `smad.simulators.rating.rate`.

    Raises FmiError for a unit or a map that cannot be used, RunLogError for a file that cannot.
    """
    mapped = read_map(map_path)
    with contextlib.closing(FmuPlant(open_unit(fmu), mapped)) as plant:
        runs = [read_mapped(path, mapped, measured=False) for path in inputs]
        return rate(plant, runs, within_s=within_s)


def read_mapped(path: Path, mapped: Map, *, measured: bool = True) -> GapRun:
    """The run in a table or a run log, by the columns that the map names.

    A channel may be missing, an input may not; all channels where nothing was
    `measured`. Raises FmiError and RunLogError.
    """
    columns = _columns(path, mapped)
    n = len(columns[mapped.time])
    valid = np.ones(n, dtype=bool)
    t_s = columns[mapped.time]
    back = np.flatnonzero(~(np.diff(t_s) > 0))
    if back.size or not np.isfinite(t_s).all():
        row = int(back[0]) + 1 if back.size else 0
        raise FmiError(
            f"{path}: time {mapped.time!r} does not increase at row {row + 1}",
            value=float(t_s[row]),
            action="sort the rows, and remove repeated ones",
        )

    def kind(rows: Any) -> dict[str, Any]:
        named = {name: columns.get(row.column or name) for name, row in rows.items()}
        there = {name: c for name, c in named.items() if c is not None and np.isfinite(c).any()}
        return {name: bridged(c, valid) for name, c in there.items()}

    inputs, outputs = kind(mapped.inputs), kind(mapped.channels)
    lacking = [name for name in mapped.inputs if name not in inputs]
    if lacking or (measured and not outputs):
        what = mapped.inputs[lacking[0]].column or lacking[0] if lacking else "any channel"
        raise FmiError(
            f"{path} has no column of {what}, which the map names",
            limit=", ".join(columns),
            action="correct the map, or leave the run out",
        )
    return GapRun(path.stem, t_s, inputs, outputs, valid=valid)


def _columns(path: Path, mapped: Map) -> dict[str, Any]:
    """Every column that the map names and the file has, as floats, with the time."""
    rows: dict[str, InputRow | ChannelRow] = {**mapped.inputs, **mapped.channels}
    wanted = [mapped.time, *(row.column or name for name, row in rows.items())]
    if path.name.endswith(KINDS):
        require_bounded(path)
        table = open_table(path)
        found = dict(table.columns([n for n in dict.fromkeys(wanted) if n in table.names]))
        has = table.names
    else:
        run = read_run(path)
        logged = {n: c for n, c in run.columns.items() if recorded(c).any()}
        has = list(logged)
        found = {n: np.where(recorded(c), c, np.nan) for n, c in logged.items() if n in wanted}
    if mapped.time not in found:
        raise FmiError(
            f"{path} has no time column {mapped.time!r}",
            limit=", ".join(has),
            action="name it in the map: time = …",
        )
    return {name: np.asarray(column, dtype=np.float64) for name, column in found.items()}
