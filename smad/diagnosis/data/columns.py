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
_HOLD = (
    "if it was logged on change, or slower than the others, give `hold = true` for it in the map"
)


def readable(
    run: GapRun, inputs: Sequence[Signal], channels: Sequence[Channel], say: Say
) -> GapRun:
    """The run with NaN for what is no reading, without channels that hold too few.

    An input that cannot be used, and a column beyond its range, refuse the run.
    """
    if not len(run.t_s):
        return run
    steady = _steady(run, inputs)
    given, measured = dict(run.inputs), dict(run.outputs)
    for s in inputs:
        if s.name not in given:
            continue
        declared = Declared(name=s.name, unit=s.unit, low=s.low, high=s.high, applied=True)
        found = checked(_floats(given[s.name]), declared, run.t_s)
        given[s.name] = found.values
        _tell(found, say)
        lacking = 1.0 - float(np.mean(np.isfinite(found.values)))
        if lacking == 1.0:
            say("input broken", f"{s.name} holds no number", refuses=True)
        elif lacking > _MOST_UNKNOWN:
            text = f"{s.name} holds no number in {lacking:.0%} of the samples: {_HOLD}"
            say("input sparse", text, refuses=True)
    for c in channels:
        if c.name not in measured:
            continue
        declared = Declared(name=c.name, unit=c.unit, low=c.low, high=c.high)
        found = checked(_floats(measured[c.name]), declared, run.t_s, steady)
        _tell(found, say)
        lacking = 1.0 - float(np.mean(np.isfinite(found.values)))
        measured[c.name] = found.values
        if _MOST_MISSING < lacking < 1.0:
            why = "is its sensor open?" if found.share > _MOST_MISSING else _HOLD
            say("channel sparse", f"{c.name} holds no reading in {lacking:.0%} of the samples and "
                f"is not used: {why}")  # fmt: skip
            del measured[c.name]
    return replace(run, inputs=given, outputs=measured)


def filled(run: GapRun, say: Say | None = None) -> GapRun:
    """The run without NaN in its columns; samples that had one in any of them do not count."""
    whole = np.ones(len(run.t_s), dtype=bool)
    columns = [{n: _bridged(c, whole) for n, c in kind.items()}
               for kind in (run.inputs, run.outputs)]  # fmt: skip
    if whole.all():
        return run
    if say is not None:
        every = {**run.inputs, **run.outputs}
        names = ", ".join(n for n, c in every.items() if 0 < np.sum(np.isfinite(c)) < len(c))
        count = int(np.sum(~whole))
        say(
            "gaps",
            f"{names} hold no reading in {count} of {len(whole)} samples: these do not count",
        )
    return replace(run, inputs=columns[0], outputs=columns[1], valid=run.good & whole)


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


def _tell(found: Checked, say: Say) -> None:
    for note in found.notes:
        say("no reading", f"{note}; these do not count")
    if found.refusal:
        say("out of range", found.refusal, refuses=True)


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
