"""The goals of the scores, by question."""

from __future__ import annotations

import msgspec

from smad.diagnosis.verdict import CHANGED, CHECK_UP, DIFFERS


class Row(msgspec.Struct, frozen=True):
    """One score over `count` cases; an interval where it is a share, None without a case."""

    name: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    count: int = 0


class Goal(msgspec.Struct, frozen=True):
    """A bound on a score."""

    bound: float
    at_most: bool = False

    def __str__(self) -> str:
        return f"{'≤' if self.at_most else '≥'} {self.bound:.2g}"

    def met(self, value: float) -> bool:
        """Whether a score meets it."""
        return value <= self.bound if self.at_most else value >= self.bound


def _most(bound: float) -> Goal:
    return Goal(bound, at_most=True)


_NO_WORSE = {"held-out gap above that of parameters alone": _most(0.0)}
_BOTH = _NO_WORSE | {
    "parameters given a cause": _most(1 / 20),
    "error of the probabilities of places": _most(0.06),
    "error of the probabilities of names": _most(0.06),
    "right name first, of noticed listed": Goal(0.85),
    "right name reported, of noticed listed": Goal(0.65),
    "right name, of names reported": Goal(0.92),
    "unlisted reported by name": _most(0.10),
}
GOALS: dict[str, dict[str, Goal]] = {
    CHECK_UP: _BOTH
    | {
        "quiet benches called changed": _most(1 / 60),
        "noticed near 1 floor": Goal(0.75),
        "noticed near 3 floors": Goal(0.97),
        "noticed near 10 floors": Goal(1.00),
        "place right first, listed": Goal(0.92),
        "place right first, unlisted": Goal(0.80),
        "reported places hold the truth, listed": Goal(0.97),
        "reported places hold the truth, unlisted": Goal(0.93),
        "reported places, mean number": _most(2.0),
        "gap gone, listed": Goal(0.90),
        "gap gone, unlisted": Goal(0.70),
        "pairs: both places among the first three": Goal(0.60),
        "left out: reported by name all the same": _most(0.10),
        "processor time, median": _most(8.0),
    },
    CHANGED: _BOTH
    | {
        "quiet benches called changed": _most(1 / 20),
        "noticed near 3 floors": Goal(0.75),
        "noticed near 10 floors": Goal(0.95),
        "reported places hold the truth, listed": Goal(0.97),
        "processor time, median": _most(20.0),
    },
    DIFFERS: _NO_WORSE
    | {
        "added effect's place among the first three": Goal(0.70),
        "own differences among the first four places": Goal(0.70),
        "processor time, median": _most(20.0),
    },
}
"""Question → row → goal. A row that is absent has none."""
