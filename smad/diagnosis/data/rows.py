"""Runs on a common grid (bins of the programme's clock), and which have the same inputs.

A row is the mean of the samples of one bin. A row with lost samples counts only where it is
compared with a prediction of the same samples (`partly`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.errors import PairingError
from smad.diagnosis.plant import Array, Index, Mask, PlantModel, Signal
from smad.diagnosis.runs import GapRun

_EDGE = 0.05
_SAME_INPUT = 0.02
_OTHER_INPUT = 0.25
_NEARLY = 0.1
MOSTLY = 0.8
"""Least share of its samples: with fewer the noise of a row is more than 12 % larger."""
LOST = 1.5
"""Step, in usual steps of a time, above which samples are lost."""
_LIKE = 0.05
"""Mean difference of two runs with the same inputs, as a share of an input's travel."""
_LEAST_MOVE = 0.1
"""Least travel of an input, as a share of its range: less may be noise."""
_LEAST_SHARE = 0.05
"""Least share of a run that both must have recorded."""

Run = TypeVar("Run")


@dataclass(frozen=True)
class Binned:
    """One run on the grid: means and whether they count, both (bins, channels).

    `inputs` are the means of the inputs over their ranges (bins, inputs); bins that were not
    recorded are 0.
    """

    name: str
    values: Array
    valid: Mask
    inputs: Array
    covered: Mask

    @property
    def share(self) -> float:
        """How much of the grid was recorded."""
        return float(self.covered.mean()) if len(self.covered) else 0.0


def edges_s(run: GapRun) -> Array:
    """When an input steps by more than a twentieth of its largest size, first to last, (k,)."""
    out: list[float] = []
    for column in run.inputs.values():
        largest = float(np.abs(column).max(initial=0.0))
        if largest > 0.0:
            edge_rows = np.flatnonzero(np.abs(np.diff(column)) > _EDGE * largest) + 1
            out += run.t_s[edge_rows].tolist()
    return np.unique(np.array(out))


def offset_s(run: GapRun, reference: GapRun) -> float:
    """Clock offset of `run` against the reference, by the steps of their inputs.

    The median over the reference's steps, each matched with the nearest of the run after the first
    steps are aligned.
    """
    edges, reference_edges = edges_s(run), edges_s(reference)
    if not len(edges) or not len(reference_edges):
        return float(run.t_s[0] - reference.t_s[0])
    first = edges[0] - reference_edges[0]
    index = np.searchsorted(edges, reference_edges + first)
    left, right = np.clip(index - 1, 0, len(edges) - 1), np.clip(index, 0, len(edges) - 1)
    off = np.stack([edges[left] - reference_edges, edges[right] - reference_edges]) - first
    nearest = np.where(np.abs(off[0]) < np.abs(off[1]), off[0], off[1])
    close = nearest[np.abs(nearest) < PERIOD_S]
    # Only the start counts: a clock that runs fast is a finding, not an offset.
    head = close[: max(8, len(close) // 4)]
    return float(first + (np.median(head) if len(head) else 0.0))


def bin_numbers(run: GapRun, start_s: float, period_s: float) -> Index:
    """Bin of each sample, by the middle of the interval that it ends, (n,)."""
    middle = run.t_s - 0.5 * run.dt_s - start_s
    return run.period_numbers(middle, period_s, 1e-9)


def _whole_bin(dt_s: float, period_s: float) -> float:
    """Samples of a complete bin."""
    usual = max(period_s / max(dt_s, 1e-9), 1.0)
    near = round(usual)
    return float(near if abs(usual - near) < _NEARLY else np.floor(usual))


def steps_in_gaps(run: GapRun, inputs: Sequence[Signal]) -> dict[str, tuple[Index, Index]]:
    """Inputs that step by more than a twentieth of their range while samples are lost.

    By name the last sample before each such gap and the first after it, (k,) each. A change at the
    rate beside the gap is no step.
    """
    index = np.flatnonzero(run.good)
    gaps = np.flatnonzero(np.diff(run.t_s[index]) > LOST * run.dt_s)
    begins, ends = index[gaps], index[gaps + 1]
    out = {}
    for signal in inputs:
        column = np.asarray(run.inputs.get(signal.name, np.zeros(len(run.t_s))))
        change = np.abs(np.diff(column, prepend=column[:1], append=column[-1:]))
        expected = 0.5 * (change[begins] + change[ends + 1]) * (ends - begins)
        beyond = np.abs(column[ends] - column[begins]) - expected
        stepped = beyond > _EDGE * (signal.high - signal.low)
        if stepped.any():
            out[signal.name] = begins[stepped], ends[stepped]
    return out


def binned(
    run: GapRun,
    bins: int,
    plant: PlantModel,
    start_s: float,
    period_s: float = PERIOD_S,
    *,
    partly: bool = False,
) -> Binned:
    """The run in `bins` bins of the grid that begins at `start_s` of its own clock.

    `partly`: a row counts, too, that lacks at most a fifth of its samples, unless an input steps
    while they are lost.
    """
    number = bin_numbers(run, start_s, period_s)
    inside = (number >= 0) & (number < bins)
    bin_of_row = number[inside]
    whole = _whole_bin(run.dt_s, period_s)
    unknown = np.zeros(bins, dtype=bool)
    for begins, ends in steps_in_gaps(run, plant.inputs).values() if partly else ():
        for first, last in zip(number[begins], number[ends], strict=True):
            unknown[max(first, 0) : max(last + 1, 0)] = True
    least = np.where(unknown, whole, MOSTLY * whole) if partly else whole

    def mean(column: Array, good: Mask) -> tuple[Array, Mask]:
        keep = good[inside] & np.isfinite(column[inside])
        count = np.bincount(bin_of_row[keep], minlength=bins)
        total = np.bincount(bin_of_row[keep], column[inside][keep], minlength=bins)
        return total / np.maximum(count, 1), count >= least

    everything = np.ones(len(run.t_s), dtype=bool)
    values = np.zeros((bins, len(plant.channels)))
    valid = np.zeros(values.shape, dtype=bool)
    for c, channel in enumerate(plant.channels):
        if channel.name in run.outputs:
            y = np.asarray(run.outputs[channel.name], float)
            values[:, c], valid[:, c] = mean(y, run.good)
    applied = np.zeros((bins, len(plant.inputs)))
    for i, signal in enumerate(plant.inputs):
        if signal.name in run.inputs:
            means, _ = mean(np.asarray(run.inputs[signal.name], float), everything)
            applied[:, i] = means / (signal.high - signal.low)
    covered = np.bincount(bin_of_row[run.good[inside]], minlength=bins) >= whole
    return Binned(run.name, values, valid, applied, covered)


def input_difference(now: Binned, reference: Binned) -> Array:
    """|difference| of the inputs over their ranges, in bins that both recorded; (bins, inputs)."""
    both = now.covered & reference.covered
    return np.where(both[:, None], np.abs(now.inputs - reference.inputs), 0.0)


def without_other_end(now: Binned, reference: Binned) -> Binned:
    """The run up to where its inputs leave the reference's for good, as after an early end."""
    other = input_difference(now, reference).max(axis=1) > _OTHER_INPUT
    covered = np.flatnonzero(now.covered & reference.covered)
    alike = np.flatnonzero(now.covered & reference.covered & ~other)
    if not len(alike) or alike[-1] == covered[-1]:
        return now
    before_end = np.arange(len(now.covered)) <= alike[-1]
    return replace(now, valid=now.valid & before_end[:, None], covered=now.covered & before_end)


def same_inputs(now: Binned, reference: Binned) -> bool:
    """Whether inputs are equal within 2 % but for single bins, in which an edge may be shifted.

    A difference where the reference has no edge, such as a supply cut for a sample, is another
    input.
    """
    off = input_difference(now, reference).max(axis=1)
    other = off > _SAME_INPUT
    steps = np.abs(np.diff(reference.inputs, axis=0)).max(axis=1) > _SAME_INPUT
    at_edge = np.append(steps, False) | np.insert(steps, 0, False)
    return bool(np.mean(other) < 0.01 and off.max() < _OTHER_INPUT and not (other & ~at_edge).any())


def require_like_inputs(now: Binned, reference: Binned) -> None:
    """Raises PairingError when the inputs differ by more than the model can carry over."""
    both = now.covered & reference.covered
    off = input_difference(now, reference)
    mean = float(off[both].max(axis=1).mean()) if both.any() else 1.0
    if mean > _OTHER_INPUT:
        raise PairingError(
            f"run {now.name} has other inputs than {reference.name}",
            value=f"{100 * mean:.0f} % of their span apart",
            limit=f"{100 * _OTHER_INPUT:.0f} %",
            action="play the same programme, or give the run that repeats this one",
        )


def same_programme(
    plant: PlantModel, run: GapRun, other: GapRun, period_s: float = PERIOD_S
) -> bool:
    """Whether two runs have the same inputs over what both recorded, in rows of `period_s`.

    Where no input steps, runs begin together, or have the same name.
    """
    stepped = len(edges_s(run)) and len(edges_s(other))
    if not stepped and run.name == other.name:
        return True
    start_s = other.begins_s
    bins = max(1, int(other.duration_s / period_s))
    first = binned(other, bins, plant, start_s, period_s)
    second = binned(run, bins, plant, start_s + offset_s(run, other), period_s)
    both = first.covered & second.covered
    if both.mean() < _LEAST_SHARE:
        return False
    moves = np.maximum(*(np.ptp(b.inputs[both], axis=0) for b in (first, second)))
    off = input_difference(second, first)[both] / np.maximum(moves, _LEAST_MOVE)
    # Constant inputs do not identify a programme.
    return bool((stepped or moves.max() > _LEAST_MOVE) and off.max(axis=1).mean() < _LIKE)


def grouped(runs: Sequence[Run], same: Callable[[Run, Run], bool]) -> list[list[Run]]:
    """The runs in groups, each `same` as the first of its group."""
    groups: list[list[Run]] = []
    for run in runs:
        group = next((g for g in groups if same(run, g[0])), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return groups
