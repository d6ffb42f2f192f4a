"""Comparison of a run with the nominal model: unusable channels, swapped cables.

The model itself is in question, so only swapped cables refuse a run, where each of two channels
follows the other's prediction. `--trust RUN` overrides that, and keeps channels that would be left
out.
"""

import shlex
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from smad.diagnosis.data.columns import Note
from smad.diagnosis.data.grid import Grid
from smad.diagnosis.plant import Array, Channel, PlantModel
from smad.diagnosis.runs import GapRun
from smad.records.readings import STUCK_CHANCE, STUCK_SAMPLES, longest_same

_SATURATED_SHARE = 0.2
"""Largest share of samples at a channel's limit."""
_CONSTANT_QUANTA = 1.5
"""A channel that moves by less is dead."""
_HARDLY, _FOLLOWS = 0.3, 0.5
"""Correlations of changes from row to row: hardly related, clearly related."""


def used(run: GapRun, predicted: Mapping[str, Array], plant: PlantModel, *, say: Note) -> GapRun:
    """The run with usable channels and samples; each of the others is noted.

    Refuses a run that the model cannot replay, or in which nothing moves or is measured.
    """
    for name, course in predicted.items():
        if not np.isfinite(course).all():
            from_s = run.t_s[int(np.argmin(np.isfinite(course)))]
            text = (
                f"the model gives no number for {name} from {from_s:.6g} s on, with its nominal "
                "parameters; mend it there, or leave the run out"
            )
            say("model stops", text, refuses=True)
            return run
    faults = {c.name: _fault_of(c, run, predicted) for c in plant.channels}
    for fault in faults.values():
        if fault is not None:
            say(*fault)
    usable = {name for name, fault in faults.items() if fault is None}
    run = replace(run, outputs={k: v for k, v in run.outputs.items() if k in usable})
    if not run.outputs:
        say("no channel", "no measured channel is left that can be judged", refuses=True)
        return run
    if all(np.ptp(run.inputs[s.name]) < 1e-3 * (s.high - s.low) for s in plant.inputs):
        _undriven(run, predicted, plant, say)
    return _without_stuck(run, predicted, plant, say)


def _undriven(run: GapRun, predicted: Mapping[str, Array], plant: PlantModel, say: Note) -> None:
    """Note or refuse a run with constant inputs: only a decay from its start is of use."""

    def moves(columns: Mapping[str, Array]) -> list[str]:
        return [
            c.name
            for c in plant.channels
            if c.name in run.outputs and np.ptp(columns[c.name][run.good]) > least_move(c)
        ]

    moving = moves(run.outputs)
    if not moving:
        say("no excitation", "no input ever changes: nothing can be learnt", refuses=True)
    elif not moves(predicted) and not run.trusted:
        text = (
            f"no input ever changes, nor does the model, but {', '.join(moving)} do: "
            "check that the inputs were recorded, and that the model begins in the run's state "
            f"(start of a map); if both hold, give --trust {shlex.quote(run.name)}"
        )
        say("no excitation", text, refuses=True)
    else:
        text = (
            "no input ever changes, so the state that the model begins in decides "
            f"{', '.join(moving)}; add runs with steps"
        )
        say("no excitation", text)


def least_move(channel: Channel) -> float:
    """A change that is no noise: twenty quanta, and three percent of the range."""
    return max(20 * channel.quantum, 0.03 * (channel.high - channel.low))


def _without_stuck(
    run: GapRun, predicted: Mapping[str, Array], plant: PlantModel, say: Note
) -> GapRun:
    """The run without the samples in which a noisy reading stays constant but should move."""
    valid = run.good.copy()
    for channel in plant.channels:
        if channel.name not in run.outputs or run.trusted:
            continue
        y, course = run.outputs[channel.name], predicted[channel.name]
        start, stop = longest_same(y)
        same = np.delete(np.diff(y, prepend=np.nan) == 0.0, slice(start, stop))
        usual_share = float(np.mean(same)) if len(same) else 1.0
        if stop - start < STUCK_SAMPLES or usual_share ** (stop - start - 1) > STUCK_CHANCE:
            continue
        if np.ptp(course[start:stop]) > least_move(channel):
            say(
                "stuck channel",
                f"{channel.name} stays at {y[start]:g} {channel.unit} from "
                f"{run.t_s[start]:.6g} to {run.t_s[stop - 1]:.6g} s, where the inputs should move "
                "it: these samples do not count",
            )
            valid[start:stop] = False
    return replace(run, valid=valid)


def _fault_of(
    channel: Channel, run: GapRun, predicted: Mapping[str, Array]
) -> tuple[str, str] | None:
    """Kind and text of what makes a channel of a run unusable, if anything does."""
    name = channel.name
    if name not in run.outputs:
        return "channel missing", f"{name} not recorded, so not compared"
    y = run.outputs[name]
    y = y[run.good & np.isfinite(y)]
    if not y.size:
        return "channel empty", f"{name} without any number, so not compared"
    span = float(np.ptp(y))
    expected = float(np.ptp(predicted[name]))
    dead = span < _CONSTANT_QUANTA * channel.quantum or span == 0.0
    if dead and expected > least_move(channel) and not run.trusted:
        return "constant channel", (
            f"{name} stays at {float(np.median(y)):g} {channel.unit} while the inputs should move "
            f"it by {expected:.3g} {channel.unit}: it is not used"
        )
    railed = float(np.mean((y <= channel.low) | (y >= channel.high)))
    if railed > _SATURATED_SHARE and not run.trusted:
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


def compare(
    run: GapRun, replayed: Mapping[str, Array], plant: PlantModel, period_s: float, *, say: Note
) -> None:
    """Note swapped channels, and channels that do not follow the model with these inputs."""
    grid = Grid.of(run, period_s)
    predicted = {k: grid.mean(v)[grid.valid] for k, v in replayed.items()}
    measured = {k: grid.mean(np.nan_to_num(v))[grid.valid] for k, v in run.outputs.items()}
    swapped = _swapped_twins(plant, measured, predicted)
    for a, b in swapped:
        say(
            "swapped channels",
            f"{a} and {b} look swapped: each follows the model of the other; check the wiring and "
            f"the column names, or give --trust {shlex.quote(run.name)} if they are right",
            refuses=not run.trusted,
        )
    apart, following = ([], []) if swapped else _unrelated(plant, measured, predicted)
    if apart and following:
        say(
            "channels do not follow",
            f"the model with these inputs predicts {', '.join(following)}, but not "
            f"{', '.join(apart)}: either these are of another run, or something that the model "
            "lacks drives them",
        )
    elif apart:
        say(
            "inputs do not drive the outputs",
            f"the nominal model predicts {', '.join(apart)} no better than with its inputs shifted "
            "in time: either it is far off, or inputs and outputs are of different runs; check the "
            f"file, and leave it out (--leave-out {shlex.quote(run.name)}) if they are",
        )


def _swapped_twins(
    plant: PlantModel, measured: dict[str, Array], predicted: dict[str, Array]
) -> list[tuple[str, str]]:
    findings = []
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
            findings.append((a, b))
    return findings


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

    unshifted = follows(0)
    shifted = sorted(follows(int(s)) for s in rng.integers(n // 10, n - n // 10, size=19))
    related = unshifted >= _FOLLOWS or (unshifted >= _HARDLY and unshifted > shifted[-2])
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
