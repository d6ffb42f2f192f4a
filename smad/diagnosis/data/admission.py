"""Which runs can support the question, and what is wrong with the others, by name.

The checks need no fit. Those that need a model (twins swapped, inputs that do not drive the
outputs) use one replay of the nominal model and ask only which of two readings of the same file is
far nearer to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.data.grid import LEAST_PERIODS, Grid
from smad.diagnosis.data.guards import without_repeats
from smad.diagnosis.plant import Array, Channel, PlantModel, nominal_replay
from smad.diagnosis.runs import GapRun, bridged, distinctly_named
from smad.diagnosis.verdict import Finding

_LOST_SHARE, _SATURATED_SHARE = 0.2, 0.2
"""Of the samples, that may be lost, or at a channel's limit."""
_CONSTANT_QUANTA = 1.5
"""A channel that moves by fewer is dead."""
_HARDLY, _FOLLOWS = 0.3, 0.5
"""Correlations of changes from row to row: hardly related, and clearly."""


Say = Callable[..., None]
"""Notes a finding about the run at hand: `kind`, `text`, and by name whether it `refuses` it."""


@dataclass(frozen=True)
class RunSet:
    """Runs that were given, those that are admitted (bad channels taken out), every finding."""

    given: tuple[GapRun, ...]
    admitted: tuple[GapRun, ...]
    findings: tuple[Finding, ...]

    @property
    def refused(self) -> list[str]:
        """Names of the runs that were refused, in order."""
        return list(dict.fromkeys(f.run for f in self.findings if f.refuses))


def admit(runs: Sequence[GapRun], plant: PlantModel, period_s: float) -> RunSet:
    """Checks every run. A bad channel is taken out of its run; a bad run is refused."""
    admitted, findings = [], []
    for run in runs:
        kept, found = _admit_one(run, plant, period_s)
        findings += found
        if not any(f.refuses for f in found):
            admitted.append(kept)
    return RunSet(tuple(runs), tuple(admitted), tuple(findings))


def admit_groups(
    given: Mapping[str, Sequence[GapRun]], plant: PlantModel, period_s: float
) -> dict[str, RunSet]:
    """Each group of runs (fit, hold-out, good), in an order that does not depend on the one given.

    Runs are told apart by name, no recording is in two places, and groups have those channels only
    that each has: what one group was fitted on could not be judged, or called unusual, on a group
    without it. A group of no runs asks for nothing; a run whose last channel goes is refused.
    """
    order = [sorted(group, key=lambda r: (r.digest, r.name)) for group in given.values()]
    named = dict(zip(given, distinctly_named(order), strict=True))
    once, repeats = without_repeats(named)
    sets = {role: admit(once[role], plant, period_s) for role in named}
    having = [{c for r in a.admitted for c in r.outputs} for a in sets.values() if a.admitted]
    common = set.intersection(*having) if having else set()
    return {
        role: _only(RunSet(tuple(named[role]), a.admitted, (*a.findings, *repeats[role])), common)
        for role, a in sets.items()
    }


def _only(group: RunSet, channels: set[str]) -> RunSet:
    admitted, findings = [], list(group.findings)
    for run in group.admitted:
        kept = {k: v for k, v in run.outputs.items() if k in channels}
        for name in (n for n in run.outputs if n not in channels):
            text = f"runs of another group all lack {name}: its residual is switched off"
            findings.append(Finding(run.name, "channel not shared", text, refuses=False))
        if kept:
            admitted.append(replace(run, outputs=kept))
        else:
            text = "nothing it measured is in the runs to fit, the held out and the good ones alike"
            findings.append(Finding(run.name, "no channel", text, refuses=True))
    return RunSet(group.given, tuple(admitted), tuple(findings))


def _admit_one(run: GapRun, plant: PlantModel, period_s: float) -> tuple[GapRun, list[Finding]]:
    found: list[Finding] = []

    def say(kind: str, text: str, *, refuses: bool = False) -> None:
        found.append(Finding(run.name, kind, text, refuses))

    if run.cut_short:
        say("truncated", f"the log is cut short; {run.duration_s:.1f} s were read up to the cut")
    for note in run.notes:
        say("note", note)
    _check_time(run, period_s, say)
    lacking = [s.name for s in plant.inputs if s.name not in run.inputs]
    if lacking:
        say("input missing", f"inputs are missing: {', '.join(lacking)}", refuses=True)
    run = _filled(run, say)
    broken = [n for n, v in run.inputs.items() if not np.isfinite(v).all()]
    if broken:
        say("input broken", f"inputs hold no number: {', '.join(broken)}", refuses=True)
    if any(f.refuses for f in found):
        return run, found
    if all(np.ptp(run.inputs[s.name]) < 1e-3 * (s.high - s.low) for s in plant.inputs):
        say("no excitation", "no input ever changes: nothing can be learnt", refuses=True)
        return run, found
    predicted = nominal_replay(run, plant)
    given, run = run, _check_channels(run, predicted, plant, say=say)
    if not run.outputs:
        say("no channel", "no measured channel is left that can be judged", refuses=True)
        return run, found
    # A replay may begin from what was measured.
    if run.outputs.keys() != given.outputs.keys():
        predicted = nominal_replay(run, plant)
    _check_against_model(run, predicted, plant, period_s, say=say)
    return run, found


def _check_time(run: GapRun, period_s: float, say: Say) -> None:
    if not run.duration_s >= LEAST_PERIODS * period_s:
        say(
            "too short",
            f"{run.duration_s:.1f} s long; at least {LEAST_PERIODS * period_s:g} s are needed",
            refuses=True,
        )
        return
    steps = np.diff(run.t_s)
    if not np.all(steps > 0):
        say("time runs back", "the time axis is not increasing", refuses=True)
        return
    lost = float(np.sum(steps[steps > 1.5 * run.dt_s] - run.dt_s)) / run.duration_s
    bad = 1.0 - float(np.mean(run.good))
    share = lost + bad
    if share > _LOST_SHARE:
        say(
            "samples lost",
            f"{share:.0%} of the samples are lost or marked bad; allowed: {_LOST_SHARE:.0%}",
            refuses=True,
        )
    elif share > 0.005:
        say("samples lost", f"{share:.1%} of the samples are lost or marked bad and are not used")
    if run.dt_s > 5 * period_s:
        say(
            "sampled too slowly",
            f"one sample every {run.dt_s:g} s; at most {5 * period_s:g} s",
            refuses=True,
        )


def _filled(run: GapRun, say: Say) -> GapRun:
    """The run without gaps in its channels; the samples that had one do not count."""
    finite = {name: np.isfinite(column) for name, column in run.outputs.items()}
    gappy = [name for name, good in finite.items() if good.any() and not good.all()]
    if not gappy:
        return run
    whole = np.ones(len(run.t_s), dtype=bool)
    outputs = {name: bridged(run.outputs[name], whole) for name in gappy}
    share = 1.0 - float(np.mean(whole))
    names = ", ".join(gappy)
    say("gaps", f"{names} hold no number in {share:.1%} of the samples: these do not count")
    return replace(run, outputs={**run.outputs, **outputs}, valid=run.good & whole)


def _check_channels(
    run: GapRun, predicted: Mapping[str, Array], plant: PlantModel, *, say: Say
) -> GapRun:
    """The run with the channels that can be used; the others are said."""
    faults = {c.name: _fault_of(c, run, predicted) for c in plant.channels}
    for fault in faults.values():
        if fault is not None:
            say(*fault)
    usable = {name for name, fault in faults.items() if fault is None}
    return replace(run, outputs={k: v for k, v in run.outputs.items() if k in usable})


def _fault_of(
    channel: Channel, run: GapRun, predicted: Mapping[str, Array]
) -> tuple[str, str] | None:
    """Kind and text of what makes a channel of a run unusable, if anything does."""
    name = channel.name
    if name not in run.outputs:
        return "channel missing", f"{name} is not recorded: its residual is switched off"
    y = run.outputs[name]
    y = y[run.good & np.isfinite(y)]
    if not y.size:
        return "channel empty", f"{name} holds no number: its residual is switched off"
    span = float(np.ptp(y))
    expected = float(np.ptp(predicted[name])) if name in predicted else 0.0
    dead = span < _CONSTANT_QUANTA * channel.quantum or span == 0.0
    if dead and expected > max(20 * channel.quantum, 0.03 * (channel.high - channel.low)):
        return "constant channel", (
            f"{name} stays at {float(np.median(y)):g} {channel.unit} while the inputs should move "
            f"it by {expected:.3g} {channel.unit}: it is not used"
        )
    railed = float(np.mean((y <= channel.low) | (y >= channel.high)))
    if railed > _SATURATED_SHARE:
        return "saturated channel", (
            f"{name} is at the end of its range for {railed:.0%} of the run: it is not used"
        )
    return None


def _misfit(measured: Array, predicted: Array) -> float:
    """1 − r²: the share of the measurement that no gain and offset of the prediction explains."""
    if np.std(measured) == 0 or np.std(predicted) == 0:
        return 1.0
    r = _correlation(measured, predicted)
    return 1.0 - max(r, 0.0) ** 2


def _check_against_model(
    run: GapRun, replayed: Mapping[str, Array], plant: PlantModel, period_s: float, *, say: Say
) -> None:
    grid = Grid.of(run, period_s)
    predicted = {k: grid.mean(v)[grid.valid] for k, v in replayed.items()}
    measured = {
        k: grid.mean(np.nan_to_num(v))[grid.valid] for k, v in run.outputs.items() if k in predicted
    }
    swapped = _swapped_twins(plant, measured, predicted)
    for a, b in swapped:
        say(
            "swapped channels",
            f"{a} and {b} look swapped: each follows the model of the other; "
            f"check the wiring and the column names",
            refuses=True,
        )
    if not swapped:
        apart, following = _unrelated(plant, measured, predicted)
        if apart and following:
            say(
                "channels do not follow",
                f"{', '.join(apart)} move otherwise than the inputs would make them, while "
                f"{', '.join(following)} follow: either these are of another run, or something "
                "that the model lacks drives them",
            )
        elif apart:
            say(
                "inputs do not drive the outputs",
                "the recorded inputs explain the measured channels no better than the same inputs "
                f"shifted in time ({', '.join(apart)}): inputs and outputs are not of one run",
                refuses=True,
            )


def _swapped_twins(
    plant: PlantModel, measured: dict[str, Array], predicted: dict[str, Array]
) -> list[tuple[str, str]]:
    found = []
    for channel in plant.channels:
        a, b = channel.name, channel.twin
        if not b or a > b or a not in measured or b not in measured:
            continue
        moves = float(np.std(predicted[a] - predicted[b]))
        if moves < max(20 * channel.quantum, 0.2 * float(np.std(predicted[a]))):
            continue
        straight = _misfit(measured[a], predicted[a]) + _misfit(measured[b], predicted[b])
        crossed = _misfit(measured[a], predicted[b]) + _misfit(measured[b], predicted[a])
        if crossed < 0.2 * straight and straight > 0.05:
            found.append((a, b))
    return found


def _unrelated(
    plant: PlantModel, measured: dict[str, Array], predicted: dict[str, Array]
) -> tuple[list[str], list[str]]:
    """Channels that should move and do not follow the model, and those that clearly do.

    What is compared are changes from row to row, at the lag of up to ten rows that fits best. Where
    all together follow the model by chance only (hardly at all, or no better than the same
    prediction shifted in time), a channel must follow clearly.
    """
    rng = np.random.default_rng(0)
    moving = []
    for channel in plant.channels:
        name = channel.name
        if name in measured and np.ptp(predicted[name]) > 0.05 * (channel.high - channel.low):
            y, m = np.diff(measured[name]), np.diff(predicted[name])
            if np.std(y) > 0 and np.std(m) > 0:
                moving.append((name, y, m))
    if not moving:
        return [], []
    n = len(moving[0][1])

    def follows(shift: int) -> float:
        return float(np.mean([_best_lag(y, np.roll(m, shift)) for _, y, m in moving]))

    own = follows(0)
    others = sorted(follows(int(s)) for s in rng.integers(n // 10, n - n // 10, size=19))
    related = own >= _FOLLOWS or (own >= _HARDLY and own > others[-2])
    alone = {name: _best_lag(y, m) for name, y, m in moving}
    following = [name for name, r in alone.items() if r >= _FOLLOWS]
    if related and not following:
        return [], []
    least = _HARDLY if related else _FOLLOWS
    return [name for name, r in alone.items() if r < least], following


def _best_lag(y: Array, m: Array) -> float:
    return max(_correlation(y, np.roll(m, s)) for s in range(0, 11, 2))


def _correlation(a: Array, b: Array) -> float:
    return float(np.corrcoef(a, b)[0, 1])
