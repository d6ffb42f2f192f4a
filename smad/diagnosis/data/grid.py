"""The analysis grid: rows that are means over bins of a run, and what a quick replay takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from smad.diagnosis.plant import Array, Mask
from smad.diagnosis.runs import GapRun

Index = NDArray[np.intp]

PERIOD_S = 0.2
"""Length of a row of the spring pair."""
LEAST_PERIODS = 40
"""A run must be as many rows long."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Bins of one run: the first sample of each bin, and the share of valid samples in it."""

    starts: Index
    weight: Array
    valid: Mask

    @classmethod
    def of(cls, run: GapRun, period_s: float) -> Grid:
        """Bins of `period_s`; a bin counts when at least half of its samples are valid."""
        bins = np.floor((run.t_s - run.t_s[0]) / period_s + 1e-6).astype(np.intp)
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
        """True where at least half of the samples of a bin are."""
        size = np.add.reduceat(np.ones(len(mask)), self.starts)
        out: Mask = np.add.reduceat(mask.astype(np.float64), self.starts) >= 0.5 * size
        return out


def thinned(run: GapRun, step_s: float) -> GapRun:
    """The run with its samples averaged over `step_s`.

    A sample lies at the end of the time it stands for, so that what was applied during that time is
    in force up to it. Falls back to the run itself where it is sampled no finer than that.
    """
    if run.dt_s > 0.7 * step_s or len(run.t_s) < 2:
        return run
    piece = np.floor((run.t_s - run.t_s[0]) / step_s + 1e-6).astype(np.intp)
    starts = np.flatnonzero(np.r_[True, np.diff(piece) > 0])
    size = np.diff(np.r_[starts, len(piece)]).astype(np.float64)

    def mean(column: Array) -> Array:
        return np.asarray(np.add.reduceat(np.asarray(column, np.float64), starts) / size)

    return replace(
        run,
        t_s=run.t_s[np.r_[starts[1:], len(piece)] - 1],
        inputs={k: mean(v) for k, v in run.inputs.items()},
        outputs={k: mean(v) for k, v in run.outputs.items()},
        valid=None if run.valid is None else np.logical_and.reduceat(run.valid, starts),
        whole=run,
    )
