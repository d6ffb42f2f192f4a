"""Which moment a sample belongs to: even steps of board time, steered to the host's clock.

The board's clock is even and wanders off; the host's is the one that people mean. So a stamp is
the one before plus the board time between, made a little longer or shorter until it agrees with
the host's clock. A board that lost more than a moment (it was kept from running, or restarted) has
a gap there: the stamps jump forward over it. They never go back.
"""

from __future__ import annotations

SETTLING_S = 10.0
"""A small error is gone, but for a third, after so long."""

MOST_RATE = 0.1
"""No step is stretched or shortened by a larger share of itself."""

GAP_S = 0.1
"""Stamps that are behind by more than this jump forward. So long a stall is told as a warning."""


class Stamps:
    """Unix times of samples, in rising order."""

    def __init__(self) -> None:
        self._begun_s: float | None = None
        self._t_s = 0.0
        # Seconds since the beginning; Unix times have too few digits to add small steps to.
        self._passed_s = 0.0
        self._latest_s = 0.0

    def restart(self) -> None:
        """Begin anew with the next sample, as on a port just opened."""
        self._begun_s = None

    def stamp(self, t_s: float, arrived_s: float, taken_s: float | None) -> float:
        """Return the Unix time of the sample at board time `t_s`, in s.

        `arrived_s` is when it came; `taken_s` when it was taken by the fit of the two clocks, None
        while that is unknown: then board time alone decides.
        """
        if self._begun_s is None:
            self._begun_s = max(arrived_s, self._latest_s)
            self._passed_s = 0.0
        else:
            step_s = max(t_s - self._t_s, 0.0)
            self._passed_s += step_s
            if taken_s is not None:
                self._passed_s += self._correction_s(taken_s, step_s)
        self._t_s = t_s
        self._latest_s = self._begun_s + self._passed_s
        return self._latest_s

    def _correction_s(self, taken_s: float, step_s: float) -> float:
        assert self._begun_s is not None
        late_s = taken_s - self._begun_s - self._passed_s
        if late_s > GAP_S:
            return late_s
        return step_s * min(max(late_s / SETTLING_S, -MOST_RATE), MOST_RATE)
