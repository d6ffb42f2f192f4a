"""The analysis grid: the length of a row, means over rows, and runs thinned for fast replays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.plant import Array, Index, Mask, PlantModel, Signal, traits_of
from smad.diagnosis.runs import GapRun, bridged

PERIOD_S = 0.2
"""Length of a row of the spring pair."""
MOST_ROWS = 6000
"""Most rows of all runs: the responses to all laws then take at most a gigabyte."""
_NEARLY = 0.01
_AMPLE = 1.25
LEAST_PERIODS = 40
"""Fewest rows of a run."""
_ROWS = 10
"""Rows in the correlation time of the usual channel."""
_FEWEST = 3
"""Fewest samples worth a mean; else a row is one sample."""
_STEADY = 0.5
_EDGE = 0.05
"""Step of an input, as a share of its range, at which a piece ends."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Bins of one run: the first sample of each bin, and the share of valid samples in it."""

    starts: Index
    weight: Array
    valid: Mask

    @classmethod
    def of(cls, run: GapRun, period_s: float) -> Grid:
        """Bins of `period_s`; a bin counts when at least half of its samples are valid."""
        bins = run.period_numbers(run.t_s - run.t_s[0], period_s, 1e-6)
        starts = np.flatnonzero(np.r_[True, np.diff(bins) > 0])
        good = run.good.astype(np.float64)
        size = np.add.reduceat(np.ones_like(good), starts)
        share = np.add.reduceat(good, starts) / size
        return cls(starts, good, share >= 0.5)

    def mean(self, columns: Array) -> Array:
        """Mean over the valid samples of each bin, along the last axis; 0 where it has none."""
        total = np.add.reduceat(self.weight, self.starts)
        safe = np.where(self.weight > 0, columns, 0.0)
        return np.asarray(
            np.add.reduceat(safe * self.weight, self.starts, axis=-1) / np.maximum(total, 1e-12)
        )

    def majority(self, mask: Mask) -> Mask:
        """True for bins in which at least half of the samples are True."""
        size = np.add.reduceat(np.ones(len(mask)), self.starts)
        out: Mask = np.add.reduceat(mask.astype(np.float64), self.starts) >= 0.5 * size
        return out


def thinned(run: GapRun, step_s: float, inputs: Sequence[Signal]) -> GapRun:
    """The run with its samples averaged over pieces of `step_s`, cut where an input steps.

    A sample lies at the end of its interval, and its inputs act up to it. An input whose square
    acts (`Signal.power`) is averaged accordingly. A run with samples as long as a piece is
    unchanged.
    """
    if run.dt_s > 0.7 * step_s or len(run.t_s) < 2:
        return run
    piece = run.period_numbers(run.t_s - run.t_s[0], step_s, 1e-6)
    new = np.r_[True, np.diff(piece) > 0]
    for signal in inputs:
        if signal.name in run.inputs:
            step = np.abs(np.diff(run.inputs[signal.name])) > _EDGE * (signal.high - signal.low)
            new[1:] |= step
    starts = np.flatnonzero(new)
    size = np.diff(np.r_[starts, len(piece)]).astype(np.float64)
    powers = {signal.name: signal.power for signal in inputs}

    def mean(column: Array, power: float = 1.0) -> Array:
        values = np.asarray(column, np.float64)
        if power == 1.0:
            return np.asarray(np.add.reduceat(values, starts) / size)
        acting = np.add.reduceat(np.abs(values) ** power, starts) / size
        return np.asarray(acting ** (1.0 / power))

    return replace(
        run,
        t_s=run.t_s[np.r_[starts[1:], len(piece)] - 1],
        inputs={k: mean(v, powers.get(k, 1.0)) for k, v in run.inputs.items()},
        outputs={k: mean(v) for k, v in run.outputs.items()},
        valid=None if run.valid is None else np.logical_and.reduceat(run.valid, starts),
        whole=run,
    )


def row_length_s(runs: Sequence[GapRun], plant: PlantModel) -> float:
    """Length of a row for these runs, in whole samples.

    It is a tenth of the usual correlation time; short enough for the shortest run to have a quarter
    more rows than it must, and long enough for all runs to have at most `MOST_ROWS`. Runs that are
    too short for the plant do not count beside others. It is that of the spring pair without a run,
    or without a channel that moves.
    """
    if not runs:
        return PERIOD_S
    least_s = traits_of(plant).shortest_s
    runs = [run for run in runs if run.duration_s + run.dt_s >= least_s] or runs
    usual = usual_correlation_time_s(runs, plant)
    lengths_s = [run.duration_s for run in runs]
    short_s = min(lengths_s) / (_AMPLE * LEAST_PERIODS)
    wanted_s = min(PERIOD_S if usual is None else usual / _ROWS, short_s)
    wanted_s = max(wanted_s, sum(lengths_s) / MOST_ROWS)
    sample_s = float(np.median([r.dt_s for r in runs]))
    # A mean over fewer than three samples is not worth while, unless memory demands it.
    few = wanted_s <= _FEWEST * sample_s and sum(lengths_s) <= MOST_ROWS * sample_s
    return sample_s if few else sample_s * max(float(np.ceil(wanted_s / sample_s - _NEARLY)), 1.0)


def usual_correlation_time_s(runs: Sequence[GapRun], plant: PlantModel) -> float | None:
    """Median over the channels of the time in which their autocorrelation falls to 1/e.

    Of each channel the median over the runs; None where no run has a channel that moves.
    """
    by_channel = []
    for channel in plant.channels:
        times = [_correlation_s(r, channel.name) for r in runs if channel.name in r.outputs]
        if moving := [t for t in times if t > 0.0]:
            by_channel.append(float(np.median(moving)))
    return float(np.median(by_channel)) if by_channel else None


def _correlation_s(run: GapRun, channel: str) -> float:
    """Correlation time of one channel of one run; 0 where it does not move, or only as noise."""
    if len(run.t_s) < 8 or not np.isfinite(run.outputs[channel]).any():
        return 0.0
    y: Array = bridged(np.asarray(run.outputs[channel], dtype=np.float64))
    level = y - float(np.mean(y))
    # Padded to twice the length, so that the end does not correlate with the beginning.
    power = np.abs(np.fft.rfft(level, 2 * len(y))) ** 2
    products = np.fft.irfft(power)[: len(y) // 2 + 1]
    # The drop to the first lag is noise, and does not count.
    if products[1] <= _STEADY * products[0]:
        return 0.0
    below = np.flatnonzero(products[1:] < products[1] / np.e)
    return float(below[0] + 1 if len(below) else len(products)) * run.dt_s
