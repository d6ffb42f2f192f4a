"""How much of the processor commands may take, so that a flood cannot starve the control loop.

Pure: time is an argument. A token bucket that holds time instead of tokens.
"""

from __future__ import annotations


class TimeBudget:
    """Fills with `share` of the passing time, up to `burst_ns`; work empties it.

    When it is empty, `delay_ns` says how long to wait before the next piece of work.
    """

    def __init__(self, share: float, burst_ns: int, now_ns: int) -> None:
        self.share = share
        self.burst_ns = burst_ns
        self._left_ns = float(burst_ns)
        self._at_ns = now_ns

    def spend(self, began_ns: int, ended_ns: int) -> None:
        """Take the time that a piece of work used out of the budget."""
        gained_ns = (ended_ns - self._at_ns) * self.share
        self._left_ns = min(self._left_ns + gained_ns, float(self.burst_ns))
        self._left_ns -= ended_ns - began_ns
        self._at_ns = ended_ns

    def delay_ns(self) -> int:
        """Return how long to wait until the budget is positive again; 0 when it is now."""
        return 0 if self._left_ns > 0 else int(-self._left_ns / self.share) + 1
