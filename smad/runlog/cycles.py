"""Which cycle of its motion the bench is in: from one lowest displacement to the next. Pure.

The live page counts sample by sample and a report counts a whole run; both count with `Cycles`, so
a sample has the same cycle on both.
"""

import math

TURN_MM = 0.3
"""By so much the motion has to turn back before a cycle ends: ten times the encoder's noise."""


TURN_K = 2.0
"""The same for a temperature, where a run has no motion."""


class Cycles:
    """Counts turning points. `number` is that of the present cycle, from 0; `tops` turned down."""

    def __init__(self, turn: float = TURN_MM) -> None:
        self.number = 0
        self.tops = 0
        self._turn = turn
        self._rising = True
        self._extreme = math.nan

    def add(self, value: float | None) -> int:
        """Take in the next value of the motion; return the number of its cycle.

        A cycle begins when the motion has risen by `turn` from its lowest point. The first one also
        begins with the first value.
        """
        if value is None or not math.isfinite(value):
            return self.number
        if math.isnan(self._extreme):
            self._extreme = value
        elif self._rising:
            self._extreme = max(self._extreme, value)
            if value < self._extreme - self._turn:
                self._rising, self._extreme = False, value
                self.tops += 1
        else:
            self._extreme = min(self._extreme, value)
            if value > self._extreme + self._turn:
                self._rising, self._extreme = True, value
                self.number += 1
        return self.number
