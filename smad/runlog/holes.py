"""Times of a log in which no sample was recorded, and what a recovered log says of them. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

RECOVERED_METADATA_NAME = "smad.recovered"
HOLES = "holes"
_STEPS = 2.5
_MOST = 20


def holes_in(t_s: Sequence[float] | NDArray[np.float64]) -> list[tuple[float, float]]:
    """The last time before each hole and the first after it: steps over 2.5 usual ones."""
    if len(t_s) < 3:
        return []
    times = np.asarray(t_s, dtype=np.float64)
    steps = np.diff(times)
    usual = float(np.median(steps))
    at = np.flatnonzero(steps > _STEPS * usual)
    return [(float(times[k]), float(times[k + 1])) for k in at]


def words(holes: Sequence[tuple[float, float]]) -> list[str]:
    """The holes as a log has them in its metadata, a line each; of many the first."""
    lines = [f"no samples from {begin:.3f} to {end:.3f} s" for begin, end in holes[:_MOST]]
    return lines + [f"{len(holes) - _MOST} more holes"] * (len(holes) > _MOST)
