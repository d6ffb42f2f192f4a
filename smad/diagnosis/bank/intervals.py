"""Intervals for shares and medians: Wilson's score interval and a bootstrap over cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Z95 = 1.959963984540054
RESAMPLES = 2000

T = TypeVar("T")


def wilson(hits: float, total: int) -> tuple[float, float]:
    """95 % Wilson score interval of hits/total; `hits` may be fractional. (0, 1) without cases.

    Wilson (1927); Brown, Cai & DasGupta (2001).
    """
    if total == 0:
        return 0.0, 1.0
    share = hits / total
    bend = Z95**2 / total
    centre = (share + bend / 2) / (1 + bend)
    half = Z95 * math.sqrt(max(share * (1 - share), 0.0) / total + bend / (4 * total)) / (1 + bend)
    return max(0.0, centre - half), min(1.0, centre + half)


def bootstrap(values: Sequence[T], statistic: Callable[[list[T]], float]) -> tuple[float, float]:
    """95 % percentile interval of a statistic, resampling cases. (nan, nan) without cases."""
    if not values:
        return math.nan, math.nan
    rng = np.random.default_rng(0)
    picks: NDArray[np.int64] = rng.integers(len(values), size=(RESAMPLES, len(values)))
    results = [statistic([values[i] for i in row]) for row in picks]
    low, high = np.nanpercentile(results, (2.5, 97.5))
    return float(low), float(high)
