"""The goals of the scores, by question."""

from __future__ import annotations

import msgspec

from evaluation.score.answers import CHANGED, CHECK_UP, DIFFERS


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


_QUIET = {
    "quiet benches called changed": _most(1 / 60),
    "parameters given a cause": _most(1 / 20),
    "error of the probabilities of places": _most(0.08),
    "error of the probabilities of names": _most(0.08),
}
GOALS: dict[str, dict[str, Goal]] = {
    CHECK_UP: _QUIET
    | {
        "noticed near 1 floor": Goal(0.70),
        "noticed near 3 floors": Goal(0.98),
        "noticed near 10 floors": Goal(1.00),
        "place right first, listed": Goal(0.92),
        "place right first, unlisted": Goal(0.85),
        "told places hold the truth, listed": Goal(0.98),
        "told places hold the truth, unlisted": Goal(0.95),
        "told places, mean number": _most(1.6),
        "side right": Goal(0.90),
        "first state right": Goal(0.70),
        "right name, of noticed listed": Goal(0.75),
        "right name, of names given": Goal(0.92),
        "unlisted given a name": _most(0.10),
        "gap gone with the laws, listed": Goal(0.75),
        "gap gone with the laws, unlisted": Goal(0.60),
        "pairs: both places among the first three": Goal(0.80),
        "pairs: both names right": Goal(0.50),
        "left out: its place still told": Goal(0.90),
        "processor time, median": _most(5.0),
    },
    CHANGED: _QUIET
    | {
        "noticed near 3 floors": Goal(0.75),
        "noticed near 10 floors": Goal(0.97),
        "told places hold the truth, listed": Goal(0.90),
        "right name, of noticed listed": Goal(0.75),
        "processor time, longest": _most(20.0),
    },
    DIFFERS: {
        "added effect's place among the first three": Goal(0.85),
        "added effect's entry named first at its place": Goal(0.60),
        "own differences among the first four places": Goal(0.75),
        "processor time, longest": _most(20.0),
    },
}
"""Question → row → goal. A row that is absent has none."""
