"""When an endurance run ends by itself: what was lost since its first cycles. Pure."""

import math
from collections import deque
from statistics import median

import msgspec

from smad.experiments.endurance.statistics import Cycle

SETTLING = 5
"""The first cycles of a run are those of springs that settle; they are no reference."""
WINDOW = 9
"""Reference and present are medians of so many cycles: one odd cycle ends nothing."""


class EndLimits(msgspec.Struct, frozen=True, kw_only=True):
    """What may change; None: as much as it will."""

    stroke_lost_percent: float | None = None
    resistance_up_percent: float | None = None
    shift_K: float | None = None
    place_probability: float | None = None


class LimitMonitor:
    """Takes the cycles in, and says which limit is reached."""

    def __init__(self, limits: EndLimits) -> None:
        self._limits = limits
        self._reference: dict[str, float] = {}
        self._first: list[Cycle] = []
        self._last: deque[Cycle] = deque(maxlen=WINDOW)

    def add(self, cycle: Cycle) -> str:
        """Take one cycle in; return the limit that is reached, in words, or nothing."""
        self._last.append(cycle)
        if len(self._first) < SETTLING + WINDOW:
            self._first.append(cycle)
            if len(self._first) == SETTLING + WINDOW:
                settled_cycles = self._first[SETTLING:]
                self._reference = {name: _middle(settled_cycles, name) for name in _WATCHED}
            return ""
        return self._reached(cycle.number)

    def _reached(self, number: int) -> str:
        limits = self._limits
        now = {name: _middle(self._last, name) for name in _WATCHED}
        was = self._reference
        lost = -_percent_more(now["stroke_mm"], was["stroke_mm"])
        up = _percent_more(now["resistance_ohm"], was["resistance_ohm"])
        shifted_K = now["transformation_degC"] - was["transformation_degC"]
        for value, limit, words in (
            (lost, limits.stroke_lost_percent, f"the stroke has lost {lost:.1f} %"),
            (up, limits.resistance_up_percent, f"the resistance has risen by {up:.1f} %"),
            (abs(shifted_K), limits.shift_K, f"the transformation shifted by {shifted_K:.1f} K"),
        ):
            if limit is not None and value >= limit:
                return f"{words} at cycle {number} (limit {limit:g})"
        return ""


_WATCHED = ("stroke_mm", "resistance_ohm", "transformation_degC")


def _percent_more(now: float, was: float) -> float:
    """NaN where there was nothing: a spring that is blocked has no stroke to lose."""
    return 100.0 * (now / was - 1.0) if was else math.nan


def _middle(cycles: list[Cycle] | deque[Cycle], name: str) -> float:
    values = [v for cycle in cycles if math.isfinite(v := getattr(cycle, name))]
    return median(values) if values else math.nan
