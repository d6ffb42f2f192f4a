"""The goals of the published table: one for recorded runs of any kind, one for check-ups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from smad.diagnosis.bank.score import Pair, Row

Protocol = Literal["any runs", "check-up"]


class Scored(Row, frozen=True):
    """A score beside its goal: `goal` is empty and `met` None where none applies."""

    goal: str = ""
    met: bool | None = None
    bound: float | None = None


@dataclass(frozen=True)
class Goal:
    """A bound on a score, `upper` where it has to lie between two.

    `interval_low`: the lower end of the score's interval has to reach this as well.
    """

    bound: float
    at_most: bool = False
    upper: float | None = None
    interval_low: float | None = None
    text: str = ""

    def __str__(self) -> str:
        if self.text:
            return self.text
        if self.upper is not None:
            return f"{self.bound:g}–{self.upper:g}"
        also = f", interval from {self.interval_low:g}" if self.interval_low else ""
        return f"{'≤' if self.at_most else '≥'} {self.bound:g}{also}"

    def met(self, value: float, low: float) -> bool:
        """Whether a score and the lower end of its interval meet it."""
        if self.upper is not None:
            return self.bound <= value <= self.upper
        if self.at_most:
            return value <= self.bound
        return value >= self.bound and low >= (self.interval_low or low)


def _at_least(any_runs: float | None, check_up: float | None) -> dict[Protocol, Goal]:
    both: dict[Protocol, float | None] = {"any runs": any_runs, "check-up": check_up}
    return {protocol: Goal(bound) for protocol, bound in both.items() if bound is not None}


GOALS: dict[str, dict[Protocol, Goal]] = {
    "false alarms on none": {
        "any runs": Goal(1 / 30, at_most=True, text="≤ 1 in 30"),
        "check-up": Goal(1 / 60, at_most=True, text="≤ 1 in 60"),
    },
    "detected at 1× the floor": _at_least(None, 0.80),
    "detected at 3× the floor": _at_least(0.60, 0.97),
    "detected at 10× the floor": _at_least(0.85, 0.99),
    "right name first, of the detected": {
        "any runs": Goal(0.90),
        "check-up": Goal(0.90, interval_low=0.85),
    },
    "right subsystem, of the detected": _at_least(0.95, 0.97),
    "right name in the first three": _at_least(0.95, 0.98),
    "mean probability on the truth": _at_least(0.75, 0.85),
    "unknown effects rejected, of the detected": _at_least(0.85, 0.90),
    "unknown effects named as a known one": {
        "any runs": Goal(0.05, at_most=True),
        "check-up": Goal(0.05, at_most=True),
    },
    "calibration error": {
        "any runs": Goal(0.08, at_most=True),
        "check-up": Goal(0.05, at_most=True),
    },
    "leave one effect out: rejected": _at_least(0.70, 0.85),
    "pairs: exact": _at_least(0.40, 0.75),
    "median held-out shrink, tool ÷ O1": _at_least(0.60, 0.80),
    "95 % intervals cover": {
        "any runs": Goal(0.90, upper=0.98),
        "check-up": Goal(0.90, upper=0.98),
    },
    "differs: right entry first in the budget": _at_least(0.80, None),
}
"""Row of the table → protocol → goal. A row that is absent has none."""


def protocol_of(pairs: Sequence[Pair]) -> Protocol:
    """How the bank was recorded: a check-up's key tells what differs over paired repeats."""
    return "check-up" if any(p.truth.gap_paired for p in pairs) else "any runs"


def with_goal(row: Row, protocol: Protocol, name: str = "") -> Scored:
    """The row with the goal that `name` (the row's own by default) has under the protocol."""
    goal = GOALS.get(name or row.name, {}).get(protocol)
    values = (row.name, row.value, row.low, row.high, row.count)
    if goal is None:
        return Scored(*values)
    met = None if row.value is None or row.low is None else goal.met(row.value, row.low)
    return Scored(*values, goal=str(goal), met=met, bound=goal.bound)
