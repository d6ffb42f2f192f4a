"""Replays on the grid: predictions of runs, and their slopes by parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S, thinned
from smad.diagnosis.data.rows import bin_numbers
from smad.diagnosis.numerics.threads import each
from smad.diagnosis.plant import Array, Channel, ModelPoint, PlantModel, Signal, traits_of
from smad.diagnosis.runs import GapRun

_THETA_STEP = 0.1
"""Prior standard deviations by which a parameter moves for a slope."""
_PIECES, _COARSE = 5, 2
"""Pieces of a row in a quick replay, and in one for small changes."""
_DIVERGED = 1e12
"""No reading is so large; squares and single precision would overflow."""


@dataclass(frozen=True)
class Played:
    """A run as the model replays it, thinned, with its bins on the grid."""

    run: GapRun
    inputs: tuple[Signal, ...]
    bins: int
    start_s: float = 0.0
    period_s: float = PERIOD_S

    @property
    def whole(self) -> GapRun:
        """The run as it was recorded."""
        return self.run.as_recorded

    @classmethod
    def of(
        cls,
        run: GapRun,
        inputs: Sequence[Signal],
        start_s: float = 0.0,
        period_s: float = PERIOD_S,
        pieces: int = _PIECES,
    ) -> Played:
        """The run on the grid that begins at `start_s` of its clock, thinned for a quick replay.

        A row is replayed in so many `pieces`, and more where an input steps.
        """
        (bins,) = run.period_numbers(run.t_s[-1:] - start_s, period_s, 1e-6)
        return cls(
            run=thinned(run, period_s / pieces, inputs),
            inputs=tuple(inputs),
            bins=max(int(bins), 1),
            start_s=start_s,
            period_s=period_s,
        )

    def with_fields(self, **fields: Any) -> Played:
        """The same with these fields of `GapRun` replaced, in the run as it was recorded, too."""
        run = replace(self.run, **fields)
        if run.whole is not None:
            run = replace(run, whole=replace(run.whole, **fields))
        return replace(self, run=run)

    def means(self, series: Array, *, exact: bool = False) -> Array:
        """Means of series over its samples (m, n) in each bin, (m, bins).

        `exact`: the samples are those of the run as it was recorded.
        """
        return self._exact_means(series) if exact else self._means(series)

    def on_grid(
        self, outputs: Mapping[str, Array], channels: Sequence[Channel], *, exact: bool = False
    ) -> Array:
        """Means of a replay's channels, (bins, channels)."""
        series = np.stack([outputs[c.name] for c in channels])
        return np.ascontiguousarray(self.means(series, exact=exact).T)

    @cached_property
    def _means(self) -> Callable[[Array], Array]:
        return self._means_over(self.run)

    @cached_property
    def _exact_means(self) -> Callable[[Array], Array]:
        return self._means_over(self.whole)

    def _means_over(self, run: GapRun) -> Callable[[Array], Array]:
        """A function that gives the means of series over the samples of a run in each bin."""
        number = bin_numbers(run, self.start_s, self.period_s)
        inside = slice(*(int(k) for k in np.searchsorted(number, (0, self.bins))))
        number, size, readings = number[inside], run.pieces[inside], run.readings[inside]
        # A prediction is the mean over the samples that were measured, where there are any.
        measured = np.bincount(number, readings, minlength=self.bins)[number] > 0
        size = np.where(measured, readings, size)
        filled, starts = np.unique(number, return_index=True)
        count = np.maximum(np.bincount(number, size, minlength=self.bins), 1.0)

        def means(series: Array) -> Array:
            sums = np.zeros((len(series), self.bins))
            sums[:, filled] = np.add.reduceat(series[:, inside] * size, starts, axis=1)
            return sums / count

        return means

    @property
    def coarse(self) -> Played:
        """The run in two pieces a row, for small changes.

        Two in place of five miss 2 % of a change (median over terms), at half the time. A fit whose
        parameters move far needs five.
        """
        return replace(
            Played.of(self.whole, self.inputs, self.start_s, self.period_s, _COARSE), bins=self.bins
        )


def predictions(
    plant: PlantModel, point: ModelPoint, runs: Sequence[Played], *, exact: bool = False
) -> list[Array]:
    """Predictions of all runs, each (bins, channels); NaN where the model cannot run.

    `exact` replays the inputs as they were recorded; else averaged ones, which serve for
    differences of two replays only.
    """

    def predicted(played: Played) -> Array:
        run = played.whole if exact else played.run
        outputs = plant.simulate(point, run, fast=not exact)
        return played.on_grid(outputs, plant.channels, exact=exact)

    return each(predicted, runs, traits_of(plant).together)


def finite(values: Sequence[Array]) -> bool:
    """Whether all values are finite and of a size that readings may have."""
    return all(bool((np.abs(v) < _DIVERGED).all()) for v in values)


def slopes(plant: PlantModel, point: ModelPoint, runs: Sequence[Played]) -> list[Array]:
    """Change of each run by a prior standard deviation of each parameter, (p, bins, channels)."""
    base = predictions(plant, point, runs)
    out = [np.zeros((len(plant.parameters), *b.shape)) for b in base]
    for i, q in enumerate(plant.parameters):
        value = point.theta.get(q.name, q.nominal)
        step = _THETA_STEP * q.prior_sd
        if value + step > q.high:
            step = -step
        moved = replace(point, theta={**point.theta, q.name: value + step})
        moved_outputs = predictions(plant, moved, runs)
        if finite(moved_outputs):
            for j, (new, old) in enumerate(zip(moved_outputs, base, strict=True)):
                out[j][i] = (new - old) * (q.prior_sd / step)
    return out
