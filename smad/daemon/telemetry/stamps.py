"""Which moment a sample belongs to: even steps of board time, steered to the host's clock.

The board's clock is even and wanders off; the host's is the one that people mean. So a stamp is
the one before plus the board time between, made a little longer or shorter until it agrees with
the host's clock. A board that lost more than a moment (it was kept from running, or restarted) has
a gap there: the stamps jump forward over it.

They go back in one case only. A host's clock that leapt ahead takes the stamps along, by years if
it must, and no slowing down would ever bring them back. So stamps that have been ahead by more than
`MOST_AHEAD_S` for `AHEAD_FOR_S` return to the host's clock in one step.
"""

SETTLING_S = 10.0
"""A small error is gone, but for a third, after so long."""

MOST_RATE = 0.1
"""No step is stretched or shortened by a larger share of itself."""

GAP_S = 0.1
"""Stamps that are behind by more than this jump forward. Such a stall is reported as a warning."""

MOST_AHEAD_S = 10.0
"""Stamps that are ahead by less wait for the host's clock, at nine tenths of their pace."""

AHEAD_FOR_S = 1.0
"""A clock that is back sooner than that, after a leap into the past, has not moved the stamps."""


class Stamps:
    """Unix times of samples, in rising order but for a return from far ahead."""

    def __init__(self) -> None:
        self.returned_s = 0.0
        """By how much the latest stamp went back; 0 for all but a return."""
        self._ahead_since_s: float | None = None
        self._begun_s = 0.0
        self._begins = True
        self._t_s = 0.0
        # Seconds since the beginning; Unix times have too few digits to add small steps to.
        self._passed_s = 0.0
        self._latest_s = 0.0

    def restart(self) -> None:
        """Begin anew with the next sample, as on a port just opened."""
        self._begins = True
        self._ahead_since_s = None

    def stamp(self, t_s: float, arrived_s: float, taken_s: float | None) -> float:
        """Return the Unix time of the sample at board time `t_s`, in s.

        `arrived_s` is when it came; `taken_s` when it was taken by the fit of the two clocks, None
        while that is unknown: then board time alone decides.
        """
        self.returned_s = 0.0
        if self._begins:
            self._begin(arrived_s)
        elif taken_s is not None and self._far_ahead(t_s, taken_s):
            self._begin(taken_s)
        else:
            step_s = max(t_s - self._t_s, 0.0)
            self._passed_s += step_s
            if taken_s is not None:
                self._passed_s += self._correction_s(taken_s, step_s)
        self._t_s = t_s
        self._latest_s = self._begun_s + self._passed_s
        return self._latest_s

    def _begin(self, at_s: float) -> None:
        far = self._latest_s - at_s > MOST_AHEAD_S
        self.returned_s = self._latest_s - at_s if far else 0.0
        self._begun_s = at_s if far else max(at_s, self._latest_s)
        self._passed_s = 0.0
        self._begins = False
        self._ahead_since_s = None

    def _far_ahead(self, t_s: float, taken_s: float) -> bool:
        if self._latest_s - taken_s <= MOST_AHEAD_S:
            self._ahead_since_s = None
            return False
        if self._ahead_since_s is None or t_s < self._ahead_since_s:
            self._ahead_since_s = t_s
        return t_s - self._ahead_since_s >= AHEAD_FOR_S

    def _correction_s(self, taken_s: float, step_s: float) -> float:
        late_s = taken_s - self._begun_s - self._passed_s
        if late_s > GAP_S:
            return late_s
        return step_s * min(max(late_s / SETTLING_S, -MOST_RATE), MOST_RATE)
