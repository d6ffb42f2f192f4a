"""How fast a bench is, from its records: what a row, a cell and the shortest run should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from smad.gap.model.whiten import lagged_products
from smad.gap.plant import PlantModel
from smad.gap.runs import Array, GapRun, bridged
from smad.gap.settings import Settings

_ROWS = 20
"""Rows that the usual channel's correlation time has at least."""
_FEWEST = 3
"""Samples that a mean is worth while over; a row of fewer is one sample."""
_STEADY = 0.5


def suited(settings: Settings, runs: Sequence[GapRun], plant: PlantModel) -> Settings:
    """The settings with a row, a cell and a least length of runs that suit these records.

    The times are in the proportion that `settings` has them in. A row is a 20th of the usual
    correlation time of what is measured, rounded down to a power of ten, so that it does not
    change from one handful of runs to the next; of less than three samples it is one. Without a
    channel that moves nothing changes.
    """
    usual = correlation_time_s(runs, plant)
    if usual is None:
        return settings
    # A hair less, so that rounding of the time axis puts no two samples into one row.
    sample_s = float(np.median([r.dt_s for r in runs])) * (1.0 - 1e-6)
    row_s = max(_rounded(usual / _ROWS), sample_s)
    # One that is a sample long already keeps its round length.
    if 1.01 < row_s / sample_s < _FEWEST:
        row_s = sample_s
    factor = row_s / settings.period_s
    return replace(
        settings,
        period_s=settings.period_s * factor,
        block_s=settings.block_s * factor,
        min_duration_s=settings.min_duration_s * factor,
    )


def correlation_time_s(runs: Sequence[GapRun], plant: PlantModel) -> float | None:
    """Median over the channels of the time in which their autocorrelation falls to 1/e.

    Of each channel the median over the runs; None where no run has a channel that moves.
    """
    by_channel = []
    for channel in plant.channels:
        times = [
            t for r in runs if channel.name in r.outputs if (t := _time_s(r, channel.name)) > 0.0
        ]
        if times:
            by_channel.append(float(np.median(times)))
    return float(np.median(by_channel)) if by_channel else None


def _time_s(run: GapRun, channel: str) -> float:
    """Correlation time of one channel of one run; 0 where it does not move, or only as noise."""
    valid = run.good.copy()
    if len(run.t_s) < 8 or not np.isfinite(run.outputs[channel]).any():
        return 0.0
    y: Array = bridged(np.asarray(run.outputs[channel], dtype=np.float64), valid)
    products = lagged_products([y - float(np.mean(y))], len(y) // 2)
    # What the first lag loses is noise, which says nothing of how fast the bench is.
    if products[1] <= _STEADY * products[0]:
        return 0.0
    below = np.flatnonzero(products[1:] < products[1] / np.e)
    return float(below[0] + 1 if len(below) else len(products)) * run.dt_s


def _rounded(period_s: float) -> float:
    """The power of ten below."""
    return float(10.0 ** np.floor(np.log10(period_s)))
