"""How fast a bench is, from its records: how long a row should be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import correlate

from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import Array, GapRun, bridged

_ROWS = 10
"""Rows that the usual channel's correlation time has at least."""
_FEWEST = 3
"""Samples that a mean is worth while over; a row of fewer is one sample."""
_STEADY = 0.5


def row_length_s(runs: Sequence[GapRun], plant: PlantModel) -> float:
    """Length of a row that suits these records.

    A 10th of the usual correlation time of what is measured, rounded down to twice a power of ten,
    so that it does not change from one handful of runs to the next; of less than three samples it
    is one. Without a channel that moves it is that of the spring pair.
    """
    usual = correlation_time_s(runs, plant)
    if usual is None:
        return PERIOD_S
    sample_s = float(np.median([r.dt_s for r in runs]))
    row_s = 2.0 * float(10.0 ** np.floor(np.log10(usual / _ROWS / 2.0)))
    return row_s if row_s > _FEWEST * sample_s else sample_s


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
    level = y - float(np.mean(y))
    products = correlate(level, level)[len(y) - 1 : len(y) + len(y) // 2]
    # What the first lag loses is noise, which says nothing of how fast the bench is.
    if products[1] <= _STEADY * products[0]:
        return 0.0
    below = np.flatnonzero(products[1:] < products[1] / np.e)
    return float(below[0] + 1 if len(below) else len(products)) * run.dt_s
