"""Runs of any plant by a map, and the diagnosis of a unit with them."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_device.plant.units import UNITS
from smad.arrays import Array
from smad.diagnosis import Answer, diagnose
from smad.diagnosis.data.columns import filled
from smad.diagnosis.errors import GapError, PlantMismatch
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import nominal_point
from smad.diagnosis.runs import GapRun
from smad.fmi.completed import completed
from smad.fmi.errors import FmiError
from smad.fmi.map_file import ChannelRow, InputRow, Map, read_map, require_fit
from smad.fmi.plant import FmuPlant
from smad.fmi.unit_file import open_unit
from smad.progress import Say, silent
from smad.records.channels import hold_last_value
from smad.records.column_names import unit_in
from smad.records.readings import on_lines
from smad.records.tables import left_out, read_columns, require_rising
from smad.records.units import Written, convert
from smad.runlog.paths import names_of
from smad.simulators.columns import LONG_STEP_S
from smad.simulators.expected import expected, on_standard_error
from smad.simulators.planning import Plan
from smad.simulators.rating import rate
from smad.simulators.windows import choose_window
from smad.units import alternatives, spelt, units_for

_COARSE, _SHORT = 5.0, 2.0
"""Of the lag that a map names: a longest step, and a shortest run, that make sense."""
_MOVED = 0.1
"""Of the way to the middle of its range, a parameter for a replay that is timed."""


def diagnose_unit(
    fmu: Path,
    map_path: Path,
    runs: Sequence[Path],
    *,
    good: Sequence[Path] = (),
    hold_out: Sequence[Path] = (),
    trusted: Sequence[str] = (),
    processes: int | None = None,
    progress: Say = silent,
    announced: Say = on_standard_error,
) -> Answer:
    """Where a unit and the runs disagree; as `smad.diagnosis.diagnose`.

    `trusted` are paths, or names of files, of runs that the model's opinion does not refuse. A
    unit that takes long runs in `processes`; a long computation is `announced`. The unit runs for
    as long as the answer is kept, since its page replays. Raises FmiError for a unit or a map that
    cannot be used, RunLogError for a run that cannot.
    """
    mapped = read_map(map_path)
    unit = open_unit(fmu)
    require_fit(mapped, unit)
    progress("reading")

    def read(path: Path) -> GapRun:
        return replace(read_mapped(path, mapped), trusted=bool(names_of(path) & set(trusted)))

    fit, good_runs, held_out = ([read(p) for p in paths] for paths in (runs, good, hold_out))
    every = [*fit, *good_runs, *held_out]
    mapped, taken = completed(mapped, every)
    plant = FmuPlant(unit, mapped)
    plant.window_s, why = 0.0, ""
    try:
        count = processes or 1
        with plant.in_processes(count):
            takes = expected(with_places(plant), every, _replay_s(plant, every[0]))
            if takes.slow:
                announced(takes.words(count, chosen=False))
            if any(isinstance(v, str) for v in mapped.start.values()):
                plant.window_s, why = choose_window(plant, fit, mapped.window_s)
            answer = diagnose(
                fit, plant=plant, good=good_runs, hold_out=held_out, progress=progress
            )
    except (GapError, np.linalg.LinAlgError) as error:
        if not plant.failures.why or isinstance(error, PlantMismatch):
            raise
        raise FmiError(
            f"unit {plant.name} stops or gives no number inside a run",
            value=plant.failures.why,
            action="correct the unit there, narrow the range of the parameters in the map, or "
            "leave the run out",
        ) from error
    notes = [*answer.verdict.notes, *filter(None, (taken, why)), *plant.failures.notes]
    return answer.with_verdict(notes=notes)


def _replay_s(plant: FmuPlant, run: GapRun) -> float:
    """What a replay of a run takes; the first of all starts the unit, and is made twice."""
    usable, point = filled(run), nominal_point(plant)
    plant.simulate(point, usable)
    first = plant.parameters[0]
    moved = first.nominal + _MOVED * (0.5 * (first.low + first.high) - first.nominal)
    began = time.perf_counter()
    plant.simulate(replace(point, theta={**point.theta, first.name: moved}), usable)
    return time.perf_counter() - began


def plan_unit(fmu: Path, map_path: Path, inputs: Sequence[Path], *, within_s: float = 5.0) -> Plan:
    """What runs with these inputs would show of a unit; see `smad.simulators.rating.rate`.

    Raises FmiError for a unit or a map that cannot be used, RunLogError for a file that cannot.
    """
    mapped = read_map(map_path)
    unit = open_unit(fmu)
    require_fit(mapped, unit)
    runs = [read_mapped(path, mapped, measured=False) for path in inputs]
    mapped, taken = completed(mapped, runs)
    with contextlib.closing(FmuPlant(unit, mapped)) as plant:
        return Plan(rate(plant, runs, within_s=within_s), [taken] if taken else [])


def read_mapped(path: Path, mapped: Map, *, measured: bool = True) -> GapRun:
    """The run in a table or a run log, by the columns that the map names, in the map's units.

    NaN where nothing was recorded. A channel may be missing, an input may not; all channels where
    nothing was `measured`. Raises FmiError and RunLogError.
    """
    columns, notes, stamps = _columns(path, mapped)
    t_s = _time_s(path, columns[mapped.time], mapped, "s" if mapped.time in stamps else "")

    rows: dict[str, InputRow | ChannelRow] = {**mapped.inputs, **mapped.channels}
    named = {n: columns[c] for n, row in rows.items() if (c := row.column or n) in columns}
    named = {n: c for n, c in named.items() if np.isfinite(c).any()}
    written = {n: _written(rows[n], n) for n in named}
    named = {n: written[n].values(c) for n, c in named.items()}
    inputs = {
        n: hold_last_value(c) if rows[n].hold else c for n, c in named.items() if n in mapped.inputs
    }
    outputs = {n: on_lines(c) if rows[n].hold else c for n, c in named.items() if n not in inputs}
    lacking = [name for name in mapped.inputs if name not in inputs]
    if lacking or (measured and not outputs):
        missing = mapped.inputs[lacking[0]].column or lacking[0] if lacking else "any channel"
        raise FmiError(
            f"{path} has no column of {missing}, which the map names",
            limit=", ".join(columns),
            action="correct the map, or leave the run out",
        )
    return GapRun(path.stem, t_s, inputs, outputs, notes=notes, written=written)


def _time_s(path: Path, column: Array, mapped: Map, stamp_unit: str) -> Array:
    """The time in s, by the unit of the map or of the column's name; it must increase."""
    require_rising(column, f"{path}: time {mapped.time!r}", FmiError)
    unit = stamp_unit or mapped.time_unit or unit_in(mapped.time)
    if unit in units_for("s"):
        column = convert(column, unit, "s")
    if stamp_unit or mapped.time_unit:
        return column
    step = float(np.median(np.diff(column))) if len(column) > 1 else 0.0
    length = float(np.ptp(column)) if len(column) else 0.0
    known_lag = not math.isnan(mapped.lag_s)
    longest = _COARSE * mapped.lag_s if known_lag else LONG_STEP_S
    shortest = _SHORT * mapped.lag_s if known_lag else 0.0
    short = not unit and length < shortest
    if len(column) > 2 and (step > longest or short):
        why = f"{unit} by its name, which makes no sense" if unit else "not said, and s make none"
        raise FmiError(
            f"{path}: the unit of time {mapped.time!r} is {why}",
            value=f"steps of {step:.6g} over {length:.6g}",
            limit=f"s: steps up to {longest:g}, at least {shortest:g} long"
            + " (by the lag_s of the map)" * known_lag,
            action='say it in the map: time_unit = "ms" (or s, us, ns, min, h)',
        )
    return column


def _written(row: InputRow | ChannelRow, name: str) -> Written:
    """How the column of a row stands in its file, by the map or by the column's name."""
    target, unit = spelt(row.unit), spelt(row.column_unit)
    plain = (row.scale, row.offset) == (1.0, 0.0)
    if not unit and row.column and plain and target in UNITS:
        unit = unit_in(row.column)
        unit = unit if unit in units_for(target) else ""
    unit = unit or target
    if unit != target and (unit not in units_for(target) or target not in UNITS):
        raise FmiError(
            f"the map gives {name} a column_unit that is none for a value in {row.unit}",
            value=row.column_unit,
            limit=alternatives(target),
            action="correct it, or give scale and offset",
        )
    read = Written.of(unit, target)
    if isinstance(row, ChannelRow):
        return read
    # An input's value is that of the unit.
    return replace(read, scale=row.scale * read.scale, offset=row.scale * read.offset + row.offset)


def _columns(path: Path, mapped: Map) -> tuple[dict[str, Array], tuple[str, ...], tuple[str, ...]]:
    """The columns that the map names, with the time; what was not read; which are stamps."""
    rows: dict[str, InputRow | ChannelRow] = {**mapped.inputs, **mapped.channels}
    names = [mapped.time, *(row.column or name for name, row in rows.items())]
    read = read_columns(path, mapped.csv, names)
    if broken := next(iter(read.unread.values()), ""):
        raise FmiError(broken)
    has, columns = read.names, read.numbers
    if mapped.time not in columns:
        raise FmiError(
            f"{path} has no time column {mapped.time!r}",
            limit=", ".join(has),
            action="name it in the map: time = …",
        )
    unused = left_out([n for n in has if n not in names], ", which the map does not name")
    return columns, (*read.notes, *unused), read.stamps
