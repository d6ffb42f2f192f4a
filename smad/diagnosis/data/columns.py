"""The columns of a run as they can be used: what is no reading is taken out, what lacks is bridged.

A run comes with NaN where nothing was recorded. Nothing here asks a model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.plant import Array, Channel, Mask, Signal
from smad.diagnosis.runs import GapRun, bridged
from smad.records.readings import Checked, Declared, checked

Say = Callable[..., None]
"""Notes a finding about the run at hand: `kind`, `text`, and by name whether it `refuses` it."""

_STEP = 0.05
"""Of an input's range, that it steps by."""
_NEAR = 5
"""Samples around a step in which a reading may jump."""
_MOST_MISSING = 0.2
"""Of a channel's samples, that may be missing or no reading."""
_MOST_UNKNOWN = 0.5
"""Of an input's samples, that may be missing where it was not logged on change."""
_HOLD = "give `hold = true` for it in the map if it was logged on change, or slower than the rest"


def readable(
    run: GapRun, inputs: Sequence[Signal], channels: Sequence[Channel], say: Say
) -> GapRun:
    """The run with NaN for what is no reading, without channels that hold too few.

    An input that cannot be used, and a column beyond its range, refuse the run.
    """
    if not len(run.t_s):
        return run
    n, steady = len(run.t_s), _steady(run, inputs)
    given, measured = dict(run.inputs), dict(run.outputs)
    _tell_gaps(run, say)
    for s in inputs:
        if s.name not in given:
            continue
        declared = Declared(name=s.name, unit=s.unit, low=s.low, high=s.high, applied=True)
        found = checked(_floats(given[s.name]), declared, run.t_s)
        given[s.name] = found.values
        _tell(found, say)
        known = int(np.sum(np.isfinite(found.values)))
        if not known:
            say("input broken", f"{s.name} holds no number", refuses=True)
        elif known < _MOST_UNKNOWN * n:
            text = f"{s.name} holds a number in {known} of {n} samples only: {_HOLD}"
            say("input sparse", text, refuses=True)
    for c in channels:
        if c.name not in measured:
            continue
        declared = Declared(name=c.name, unit=c.unit, low=c.low, high=c.high)
        found = checked(_floats(measured[c.name]), declared, run.t_s, steady)
        _tell(found, say)
        known = int(np.sum(np.isfinite(found.values)))
        measured[c.name] = found.values
        if 0 < known < (1.0 - _MOST_MISSING) * n:
            why = "is its sensor open?" if found.share > _MOST_MISSING else _HOLD
            text = f"{c.name} holds a reading in {known} of {n} samples only and is not used: {why}"
            say("channel sparse", text)
            del measured[c.name]
    return replace(run, inputs=given, outputs=measured)


def _tell_gaps(run: GapRun, say: Say) -> None:
    """Say which columns hold no number in a few samples."""
    gaps = {n: ~np.isfinite(_floats(c)) for n, c in {**run.inputs, **run.outputs}.items()}
    few = {n: g for n, g in gaps.items() if 0 < np.sum(g) <= _MOST_MISSING * len(g)}
    if few:
        count = int(np.sum(np.logical_or.reduce(list(few.values()))))
        text = f"{', '.join(few)} hold no number in {count} of {len(run.t_s)} samples"
        say("gaps", f"{text}: these do not count")


def filled(run: GapRun) -> GapRun:
    """The run without NaN in its columns; samples that had one in any of them do not count."""
    whole = np.ones(len(run.t_s), dtype=bool)
    inputs, outputs = (
        {n: _bridged(c, whole) for n, c in kind.items()} for kind in (run.inputs, run.outputs)
    )
    if whole.all():
        return run
    return replace(run, inputs=inputs, outputs=outputs, valid=run.good & whole)


def _bridged(column: Array, whole: Mask) -> Array:
    values = _floats(column)
    return bridged(values, whole) if np.isfinite(values).any() else values


def up_to_first_hole(run: GapRun, row_s: float, say: Say) -> GapRun:
    """The run up to its first time without samples, or without inputs, that is longer than a row.

    What the model would be driven by in a hole is not known, so neither is the state after it. A
    single lost sample of a slow log is no hole.
    """
    step_s, t_s = run.dt_s, run.t_s
    longest_s = max(row_s, 2.5 * step_s)
    known = np.ones(len(t_s), dtype=bool)
    for column in run.inputs.values():
        known &= np.isfinite(column)
    index = np.flatnonzero(known)
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
    more = f" (and {len(holes) - 1} more holes)" if len(holes) > 1 else ""
    say(
        "hole",
        f"what was applied from {first:.6g} to {last:.6g} s is not recorded{more}: the run is used "
        f"up to {first:.6g} s, {first - t_s[0]:.3g} of its {run.duration_s:.3g} s",
    )
    return run.part(0, int(np.searchsorted(t_s, first, side="right")))


def _tell(column: Checked, say: Say) -> None:
    for note in column.notes:
        say("no reading", f"{note}; these do not count")
    if column.refusal:
        say("out of range", column.refusal, refuses=True)


def _steady(run: GapRun, inputs: Sequence[Signal]) -> Mask:
    """Where no input steps within a few samples, shape (n,)."""
    stepping = np.zeros(len(run.t_s), dtype=bool)
    for s in inputs:
        if s.name in run.inputs:
            step = np.abs(np.diff(_floats(run.inputs[s.name]), prepend=run.inputs[s.name][0]))
            stepping |= ~(step <= _STEP * (s.high - s.low))
    return np.asarray(np.convolve(stepping, np.ones(2 * _NEAR + 1), mode="same") < 0.5)


def _floats(column: Array) -> Array:
    return np.asarray(column, dtype=np.float64)
