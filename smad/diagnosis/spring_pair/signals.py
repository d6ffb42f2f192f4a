"""Channels, regimes and traits of the spring pair, and its runs from logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from smad.diagnosis.data.columns import filled, readable, up_to_first_hole
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.errors import GapError
from smad.diagnosis.numerics.lag import lagged
from smad.diagnosis.plant import Array, Channel, Mask, Signal, StartReading, Traits
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent
from smad.records.channels import LONGEST_STEP_S, RANGES, MappingFile, read_channels
from smad.records.declared import BEYOND
from smad.records.tables import left_out
from smad.records.units import Written
from smad.runlog import schema
from smad.runlog.bounds import Together
from smad.runlog.paths import distinct_name, names_of

if TYPE_CHECKING:
    from smad.runlog.reader import Run

INPUTS = (
    Signal("i_applied_x_A", "A", *RANGES["i_applied"], power=2.0),
    Signal("i_applied_y_A", "A", *RANGES["i_applied"], power=2.0),
    Signal("duty_x", "1", *RANGES["duty"]),
    Signal("duty_y", "1", *RANGES["duty"]),
)
_OPTIONAL_INPUTS = ("drain_x", "drain_y")
_HIGHEST = {s.name: s.high for s in INPUTS}


def _channel(stem: str, unit: str, side: str = "") -> Channel:
    """A channel whose converter counts thousandths (of a temperature hundredths), noise of two."""
    quantum = 0.01 if unit == "degC" else 0.001
    named = {s: f"{stem}_{s}_{unit}" for s in "xy"}
    name = named.get(side, f"{stem}_{unit}")
    low, high = RANGES[stem.removesuffix("_inlet").removesuffix("_ambient")]
    return Channel(
        name=name,
        unit=unit,
        quantum=quantum,
        low=low,
        high=high,
        noise=2 * quantum,
        side=side.upper(),
        twin=named["y" if side == "x" else "x"] if side else "",
        words=schema.CHANNELS[name].description,
    )


CHANNELS = (
    *(_channel("i_meas", "A", s) for s in "xy"),
    *(_channel("v", "V", s) for s in "xy"),
    *(_channel("rtd", "degC", s) for s in "xy"),
    _channel("rtd_inlet", "degC"),
    _channel("rtd_ambient", "degC"),
    _channel("displacement", "mm"),
    _channel("force", "N"),
)
TRAITS = Traits(
    day={
        "tube_loss": 0.15,
        "flow_max": 0.15,
        "film_scale": 0.15,
        "water_temperature": 0.03,
        "ambient_temperature": 0.03,
        "initial_deflection": 0.1,
        "displacement_zero": 0.1,
    },
    environment={"water_temperature": "rtd_inlet_degC", "ambient_temperature": "rtd_ambient_degC"},
    drift={"inlet_water": 0.2, "ambient_air": 0.2},
    starts={
        "rtd_x_degC": StartReading(error=0.15, above="rtd_inlet_degC"),
        "rtd_y_degC": StartReading(error=0.15, above="rtd_inlet_degC"),
        "displacement_mm": StartReading(error=0.02),
        "force_N": StartReading(error=0.025, taken=False),
    },
    longest_step_s=LONGEST_STEP_S,
)
"""Loss, flow, film and temperatures beyond what is measured. Water and room wander within a run.
Errors of `starts`: the tolerance of a Pt element of class A, some steps of the encoder, and by how
much strokes change the tension at rest. A tension that is read would hide that preload is lost."""
_RATE_TAU_S = 0.3


def smooth(y: Array, dt_s: float, tau_s: float) -> Array:
    """Exponential smoothing of samples (n,) forth and back, without delay."""
    keep = float(np.exp(-dt_s / tau_s))
    return lagged(lagged(y, keep)[::-1], keep)[::-1]


def means_over_pieces(run: GapRun, y: Array) -> Array:
    """Means over a thinned run's samples of values at their ends, taken as linear between.

    Unchanged in a run that is not thinned.
    """
    back = 0.5 - 0.5 / run.pieces[1:]
    out = y.copy()
    out[1:] -= back * (y[1:] - y[:-1])
    return out


def _recent(active: Mask, dt_s: float, memory_s: float) -> Mask:
    """True from an active sample until `memory_s` after it."""
    n = max(1, round(memory_s / dt_s))
    count = np.cumsum(np.r_[np.zeros(n), active.astype(float)])
    return np.asarray(count[n:] - count[: len(active)] > 0.5)


def _near(edge: Mask, dt_s: float, width_s: float) -> Mask:
    n = max(1, round(width_s / dt_s))
    return np.asarray(np.convolve(edge.astype(float), np.ones(2 * n + 1), mode="same") > 0.5)


def _speed(run: GapRun) -> Array:
    if "displacement_mm" not in run.outputs:
        return np.zeros(len(run.t_s))
    course = smooth(run.outputs["displacement_mm"], run.dt_s, _RATE_TAU_S)
    return np.asarray(np.gradient(course, run.dt_s))


def _warmth(run: GapRun, side: str) -> Array:
    """Measured temperature of a spring above its water; 0 without a reading."""
    name = f"rtd_{side}_degC"
    if name not in run.outputs:
        return np.zeros(len(run.t_s))
    inlet = run.outputs.get("rtd_inlet_degC")
    start = max(1, round(1.0 / run.dt_s))
    base = float(np.median((run.outputs[name] if inlet is None else inlet)[:start]))
    return run.outputs[name] - base


def regimes(run: GapRun, side: str) -> dict[str, Mask]:
    """Regimes of one spring ("X", "Y") or of the pair (""): see `smad.diagnosis.plant`.

    Order is precedence where a row must belong to one only.
    """
    sides = (side.lower(),) if side else ("x", "y")
    dt_s, speed = run.dt_s, _speed(run)
    current = np.max([run.inputs[f"i_applied_{s}_A"] for s in sides], axis=0)
    water = np.max([run.inputs[f"duty_{s}"] for s in sides], axis=0) > 0.02
    driven = np.max([run.inputs[s.name] for s in INPUTS], axis=0) > 0.01
    warm = np.max([_warmth(run, s) for s in sides], axis=0) > 2.0
    any_warm = np.max([_warmth(run, s) for s in ("x", "y")], axis=0) > 0.7
    moving = np.abs(speed) > 0.05
    turns = np.r_[False, np.diff(np.sign(np.where(moving, speed, 0.0))) != 0]
    force = run.outputs.get("force_N")
    out = {"rest": ~_recent(driven, dt_s, 2.0) & ~any_warm & ~moving}
    if force is not None:
        out["near-zero force"] = smooth(force, dt_s, 0.1) < 0.35
    heating = current > 0.2
    return out | {
        "reversal": _near(turns, dt_s, 0.4),
        "pump on": water,
        "heating": heating,
        "air cooling": ~heating & ~water & warm,
        "holding": ~moving,
    }


def run_from_columns(
    name: str,
    columns: Mapping[str, NDArray[Any]],
    *,
    cut_short: bool = False,
    notes: tuple[str, ...] = (),
    written: Mapping[str, Written] | None = None,
) -> GapRun:
    """A run from the columns of a run log (`smad.runlog.schema`).

    The current of the board counts as input; where a log has none, the commanded one does. A column
    of which nothing was recorded is absent; NaN where a sample was not. Noise about a current or a
    duty of 0 is 0.
    """
    t_s = np.asarray(columns["t_s"], dtype=np.float64)
    inputs: dict[str, Array] = {}
    for input_name in (*(s.name for s in INPUTS), *_OPTIONAL_INPUTS):
        column = _recorded(columns, input_name)
        if column is None and input_name.startswith("i_applied"):
            column = _recorded(columns, input_name.replace("applied", "cmd"))
        if column is not None:
            high = _HIGHEST.get(input_name, 1.0)
            inputs[input_name] = np.where((column < 0.0) & (column > -BEYOND * high), 0.0, column)
    recorded = {c.name: _recorded(columns, c.name) for c in CHANNELS}
    outputs = {name: y for name, y in recorded.items() if y is not None}
    written = dict(written or {})
    for stem in ("i_applied_x_A", "i_applied_y_A"):
        written.setdefault(stem, written.get(stem.replace("applied", "cmd"), Written()))
    return GapRun(name, t_s, inputs, outputs, cut_short=cut_short, notes=notes, written=written)


def _table_run(path: Path, together: Together | None, mapping: MappingFile | None) -> GapRun:
    """A table made elsewhere (`smad.records.channels`) as a run of the diagnosis.

    Readings in rows with a `valid` of 0 are NaN: they must neither be compared with a model nor
    start it. A run without other rows keeps them for its admission, which refuses it.
    """
    name = path.name.split(".")[0]
    table = read_channels(path, together, mapping)
    columns = table.columns
    notes = (*table.notes, *left_out(table.assignment.ignored))
    flagged = columns.pop("valid", None)
    use = None if flagged is None else np.nan_to_num(flagged) > 0.5
    if use is not None and use.any():
        measured = {c.name for c in CHANNELS} & columns.keys()
        columns |= {k: np.where(use, columns[k], np.nan) for k in measured}
    run = run_from_columns(name, columns, notes=notes, written=table.written)
    return replace(run, valid=use)


def _recorded(columns: Mapping[str, NDArray[Any]], name: str) -> Array | None:
    if name not in columns:
        return None
    raw = columns[name]
    column = np.asarray(raw, dtype=np.float64)
    if raw.dtype.kind in "iu":
        column = np.where(raw < 0, np.nan, column)
    return column if np.isfinite(column).any() else None


def read_gap_run(
    path: str | Path, together: Together | None = None, mapping: MappingFile | None = None
) -> GapRun:
    """A run log or a table as it was recorded; the admission of a diagnosis looks at its values.

    `mapping` says how a table is written, `together` counts what is held in memory. Raises
    RunLogError (of a table LogImportError) when it cannot be read at all, or is too much for that.
    """
    return _read(Path(path), together, mapping)[0]


def read_gap_runs(
    paths: Sequence[Path],
    among: Sequence[Path],
    trusted: Sequence[str] = (),
    mapping: MappingFile | None = None,
    progress: Say = silent,
) -> list[GapRun]:
    """The runs of files, each with a name that only one of the files in `among` has.

    `trusted` are names or paths of runs to trust, `mapping` says how tables are written. Raises as
    `read_gap_run` does.
    """
    together, runs = Together(), []
    for path in paths:
        progress(f"reading {path.name}")
        run = read_gap_run(path, together, mapping)
        name = distinct_name(path, among) or run.name
        runs.append(replace(run, name=name, trusted=bool(names_of(path) & set(trusted))))
    return runs


def read_recorded(path: Path, together: Together | None = None) -> tuple[GapRun, Run | None]:
    """A run log or a table up to its first hole, with columns that can be used, and its log.

    Values that are no readings become NaN; these and a hole are noted. Raises as `read_gap_run`
    does, and GapError for an input or a channel with values that it cannot have.
    """
    run, log = _read(path, together)
    used, notes, refused = _usable(run)
    if refused:
        raise GapError(f"{path}: {refused[0]}")
    return replace(used, notes=(*run.notes, *notes)), log


def _usable(run: GapRun) -> tuple[GapRun, list[str], list[str]]:
    """The run up to its first hole, notes on what was left out, and reasons to refuse the run."""
    texts: dict[bool, list[str]] = {False: [], True: []}

    def say(kind: str, text: str, *, refuses: bool = False) -> None:
        texts[refuses].append(text)

    read = readable(run, INPUTS, CHANNELS, say, LONGEST_STEP_S)
    used = filled(up_to_first_hole(read, PERIOD_S, say))
    return used, texts[False], texts[True]


def _read(
    path: Path, together: Together | None, mapping: MappingFile | None = None
) -> tuple[GapRun, Run | None]:
    if path.suffix.lower() != ".mcap":
        return _table_run(path, together, mapping), None
    from smad.runlog.reader import read_run

    log = read_run(path)
    if together is not None:
        together.take(path, rows=len(log), columns=len(log.columns))
    notes = tuple(log.notes) if not log.cut_short else ()
    run = run_from_columns(log.path.stem, log.columns, cut_short=log.cut_short, notes=notes)
    return run, log


def require_columns(path: Path, run: GapRun) -> None:
    """Raise GapError for a run of a file without one of the inputs, or without any channel."""
    lacking = [s.name for s in INPUTS if s.name not in run.inputs]
    if lacking or not run.outputs:
        raise GapError(
            f"{path} lacks columns",
            value=", ".join(lacking) or "no measured channel",
            limit="currents and duties of both springs, and at least one measured channel",
            action="add the column, in the unit its name ends with",
        )
