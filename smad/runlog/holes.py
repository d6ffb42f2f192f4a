"""Times of a log in which no sample was recorded, and what a recovered log says of them. Pure."""

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from smad.counted import counted

RECOVERED_METADATA_NAME = "smad.recovered"
HOLES = "holes"
HOLE_STEPS = 2.5
"""A hole is a step of more usual ones than this; a single lost sample makes a step of two."""
_MOST = 20


def holes_in(t_s: Sequence[float]) -> list[tuple[float, float]]:
    """The last time before each hole and the first after it: steps over `HOLE_STEPS` usual ones."""
    if len(t_s) < 3:
        return []
    steps = [(float(a), float(b)) for a, b in pairwise(t_s)]
    usual = median(b - a for a, b in steps)
    return [(a, b) for a, b in steps if b - a > HOLE_STEPS * usual]


def words(holes: Sequence[tuple[float, float]]) -> list[str]:
    """The holes as a log has them in its metadata, a line each; of many the first."""
    lines = [f"no samples from {begin:.3f} to {end:.3f} s" for begin, end in holes[:_MOST]]
    return lines + [counted(len(holes) - _MOST, "more hole")] * (len(holes) > _MOST)
