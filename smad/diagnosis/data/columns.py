"""The columns of a run made usable: values that are no readings are removed, gaps are bridged.

A run comes with NaN where nothing was recorded. Nothing here uses a model.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from smad.arrays import Array
from smad.counted import counted
from smad.diagnosis.data.rows import LOST
from smad.diagnosis.plant import Channel, Signal
from smad.diagnosis.runs import GapRun, bridged
from smad.records.declared import Declared
from smad.records.readings import checked_columns, doubted_step, on_lines
from smad.records.units import Written

EVEN = 0.1
"""Largest `jitter` of an even time."""
_SURE = 6.0
"""Three standard errors of the median step, in units of jitter over the root of their number."""
Note = Callable[..., None]
"""Called as say(kind, text, refuses=False): adds a finding about the run that is checked."""


def readable(
    run: GapRun,
    inputs: Sequence[Signal],
    channels: Sequence[Channel],
    say: Note,
    longest_step_s: float = math.inf,
) -> GapRun:
    """The run with NaN in place of values that are no readings, without channels that hold too few.

    The run is refused for an unusable input, a column beyond its range, or samples further apart
    than `longest_step_s`.
    """
    if not len(run.t_s):
        return run
    if text := doubted_step(run.t_s, longest_step_s):
        say("time step", text, refuses=True)
    signals: list[Signal | Channel] = [*inputs, *channels]
    declared = [
        Declared(
            name=s.name,
            unit=s.unit,
            low=s.low,
            high=s.high,
            applied=isinstance(s, Signal),
            written=run.written.get(s.name, Written()),
        )
        for s in signals
    ]
    columns, remarks = checked_columns({**run.inputs, **run.outputs}, declared, run.t_s)
    for remark in remarks:
        applied, text = remark.name in run.inputs, remark.text
        if remark.kind in ("gaps", "no reading"):
            say(remark.kind, f"{text}; these do not count")
        elif remark.kind == "repeated":
            say(remark.kind, f"{text}; it is read on lines between the first of each")
            columns[remark.name] = on_lines(columns[remark.name], remark.rows)
        elif remark.kind == "out of range":
            say(remark.kind, text, refuses=True)
        elif applied:
            advice = f": {remark.advice}" if remark.advice else ""
            say("input unknown", f"{text}{advice}", refuses=True)
        elif remark.kind == "sparse":
            say("channel sparse", f"{text} and is not used: {remark.advice}")
            del columns[remark.name]
    return replace(
        run,
        inputs={n: columns[n] for n in run.inputs},
        outputs={n: columns[n] for n in run.outputs if n in columns},
    )


def filled(run: GapRun) -> GapRun:
    """The run with NaN interpolated; samples with NaN in any column are not valid."""
    whole = np.ones(len(run.t_s), dtype=bool)
    for column in (*run.inputs.values(), *run.outputs.values()):
        finite = np.isfinite(column)
        if finite.any():
            whole &= finite
    if whole.all():
        return run
    inputs, outputs = (
        {n: bridged(np.asarray(c, dtype=np.float64)) for n, c in kind.items()}
        for kind in (run.inputs, run.outputs)
    )
    return replace(run, inputs=inputs, outputs=outputs, valid=run.good & whole)


def lost_share(t_s: Array) -> float:
    """Share of samples missing in a time (n,); 0 if jitter can explain it."""
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    lost = 1.0 - usual * len(steps) / float(np.sum(steps))
    return lost if lost > _SURE * jitter(t_s) / np.sqrt(len(steps)) else 0.0


def jitter(t_s: Array) -> float:
    """Median deviation of a time's steps (n,) from the median step, relative to it."""
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    return float(np.median(np.abs(steps - usual))) / usual


def with_lost(run: GapRun) -> GapRun:
    """The run with samples of NaN where an even time axis lacks some, so that its steps are equal.

    An uneven axis stays as it is: its long steps need not be lost samples.
    """
    steps = np.diff(run.t_s)
    if not (steps > LOST * run.dt_s).any() or jitter(run.t_s) > EVEN:
        return run
    place = np.r_[0, np.cumsum(np.maximum(np.rint(steps / run.dt_s), 1.0).astype(np.intp))]
    n = int(place[-1]) + 1

    def spread(column: Array) -> Array:
        out = np.full(n, np.nan)
        out[place] = column
        return out

    valid = np.zeros(n, dtype=bool)
    valid[place] = run.good
    return replace(
        run,
        t_s=np.interp(np.arange(n), place, run.t_s),
        inputs={k: spread(c) for k, c in run.inputs.items()},
        outputs={k: spread(c) for k, c in run.outputs.items()},
        valid=valid,
    )


def up_to_first_hole(run: GapRun, row_s: float, say: Note) -> GapRun:
    """The run up to its first hole: a time without samples or inputs that is longer than a row.

    In a hole the inputs are unknown, and so is the state after it. A single lost sample of a slow
    log is no hole.
    """
    step_s, t_s = run.dt_s, run.t_s
    longest_s = max(row_s, 2.5 * step_s)
    finite = np.ones(len(t_s), dtype=bool)
    for column in run.inputs.values():
        finite &= np.isfinite(column)
    index = np.flatnonzero(finite)
    if not len(index):
        return run
    begins, ends = t_s[index[:-1]], t_s[index[1:]]
    if index[0] and t_s[index[0]] - t_s[0] > longest_s:
        begins, ends = np.r_[t_s[0], begins], np.r_[t_s[index[0]], ends]
    if t_s[-1] - t_s[index[-1]] > longest_s:
        begins, ends = np.r_[begins, t_s[index[-1]]], np.r_[ends, t_s[-1]]
    holes = np.flatnonzero(ends - begins > longest_s)
    if not len(holes):
        return run
    first, last = float(begins[holes[0]]), float(ends[holes[0]])
    more = f" (and {counted(len(holes) - 1, 'more hole')})" if len(holes) > 1 else ""
    say(
        "hole",
        f"what was applied from {first:.6g} to {last:.6g} s is not recorded{more}: the run is used "
        f"up to {first:.6g} s, {first - t_s[0]:.3g} of its {run.duration_s:.3g} s",
    )
    return run.part(0, int(np.searchsorted(t_s, first, side="right")))
