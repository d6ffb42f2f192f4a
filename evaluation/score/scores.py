"""Everything that is published of a bank: scores beside their goals and beside simpler rules.

It stands on what `smad gap score` says of any bank.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from evaluation.score.goals import Scored, protocol_of, with_goal
from smad.diagnosis.bank.key import STRENGTHS
from smad.diagnosis.bank.names import NAMING
from smad.diagnosis.bank.score import (
    ABSENT,
    Bin,
    Mistake,
    Pair,
    Row,
    calibration,
    confusion,
    detected,
    mistakes,
    name_credit,
    of_kind,
    over,
    said,
    share,
    table,
)
from smad.diagnosis.bank.verdicts import Short

OURS = "the diagnosis"
_LEAST_SHRINK = 0.05


class Compared(msgspec.Struct, frozen=True):
    """A case of the question what differs between model and bench; `truth` is what was added."""

    case: str
    truth: list[str]
    outcome: str
    said: str
    budget: dict[str, float]


class Trusted(msgspec.Struct, frozen=True):
    """What the diagnosis trusts its model to on a channel, in the bank's floors of that channel.

    Median and quartiles over cases: an effect of fewer floors there is smaller than what the model
    leaves of runs without any.
    """

    channel: str
    low: float
    median: float
    high: float
    cases: int


class Published(msgspec.Struct, frozen=True):
    """All scores of one verdict file.

    `confusion` is truth → what was said → cases. `baselines` holds the same rows for the diagnosis
    itself and for every simpler rule, on the cases that have one.
    """

    bank: str
    cases: int
    answered: int
    table: list[Scored]
    by_strength: dict[str, list[Scored]]
    calibration: list[Bin]
    confusion: dict[str, dict[str, int]]
    baselines: dict[str, list[Row]]
    mistakes: list[Mistake]
    model_against_bench: list[Compared]
    trusted: list[Trusted] = []


def exact_law_row(pairs: Sequence[Pair]) -> Row:
    """Shrink beside that of the right effect in the plant itself."""
    shares = [
        p.said.shrink / exact
        for p in of_kind(pairs, "single")
        if detected(p.said)
        and p.said.shrink is not None
        and (exact := p.truth.shrink_exact_law) is not None
        and exact > _LEAST_SHRINK
    ]
    return over("median held-out shrink, tool ÷ O1", shares, statistics.median)


_OTHER_DAYS = ("room", "preload", "drift")
"""Kinds of cases without an effect on days unlike the good ones; `none` tells their goal."""


def other_days(pairs: Sequence[Pair]) -> list[Row]:
    """False alarms on days unlike those of the good runs, where the bank has such cases."""
    have = [kind for kind in _OTHER_DAYS if of_kind(pairs, kind)]
    return [
        share(f"false alarms: {kind}", [float(detected(p.said)) for p in of_kind(pairs, kind)])
        for kind in have
    ]


def by_strength(pairs: Sequence[Pair]) -> dict[str, list[Scored]]:
    """The main scores apart for 1, 3 and 10 floors."""
    out: dict[str, list[Scored]] = {"detected": [], "right name first": [], "unknown rejected": []}
    protocol = protocol_of(pairs)
    for strength in STRENGTHS:
        here = [p for p in pairs if p.truth.strength == strength]
        single, unknown = of_kind(here, "single"), of_kind(here, "unknown")
        label = f"{strength:.0f}×"
        seen = [float(detected(p.said)) for p in single + unknown]
        goal = f"detected at {label} the floor"
        named = [name_credit(p) for p in single if detected(p.said)]
        rejected = [float(p.said.outcome == "unknown") for p in unknown if detected(p.said)]
        for score, hits in zip(out, (seen, named, rejected), strict=True):
            out[score].append(
                with_goal(share(label, hits), protocol, goal if score == "detected" else label)
            )
    return out


def baseline_rows(
    pairs: Sequence[Pair], baselines: Mapping[str, Mapping[str, Short]]
) -> dict[str, list[Row]]:
    """The main scores of the diagnosis and of every simpler rule, by the same simple count.

    `baselines` are by case and rule. A group counts by its first name here, since they have none.
    """
    have = [p for p in pairs if p.case in baselines]
    if not have:
        return {}
    out = {OURS: _short_rows([(p, Short(p.said.outcome, list(p.said.first))) for p in have])}
    for name in sorted({name for p in have for name in baselines[p.case]}):
        theirs = [(p, baselines[p.case][name]) for p in have if name in baselines[p.case]]
        out[name] = _short_rows(theirs)
    return out


def _short_rows(have: Sequence[tuple[Pair, Short]]) -> list[Row]:
    def of(*kinds: str) -> list[tuple[Pair, Short]]:
        return [(p, s) for p, s in have if p.truth.kind in kinds]

    def named(p: Pair, s: Short) -> float:
        return float(frozenset(s.names) == p.truth.names and s.outcome in NAMING)

    return [
        share("false alarms on none", [float(detected(s)) for _, s in of("none", "parameters")]),
        share("single effects detected", [float(detected(s)) for _, s in of("single")]),
        share("right name first, of the detected",
              [named(p, s) for p, s in of("single") if detected(s)]),
        share("unknown effects rejected",
              [float(s.outcome == "unknown") for _, s in of("unknown")]),
        share("pairs: exact", [named(p, s) for p, s in of("pair")]),
    ]  # fmt: skip


def trusted(pairs: Sequence[Pair]) -> list[Trusted]:
    """Every channel of which both the key and the verdicts tell a floor, the worst first."""
    ratios: dict[str, list[float]] = {}
    for p in pairs:
        for channel, held in p.said.held_out.items():
            if p.truth.kind != "differs" and p.truth.floor.get(channel, 0.0) > 0.0:
                ratios.setdefault(channel, []).append(held.floor / p.truth.floor[channel])
    out = []
    for channel, values in ratios.items():
        low, median, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
        out.append(Trusted(channel, low, median, high, len(values)))
    return sorted(out, key=lambda t: (-t.median, t.channel))


def published(
    pairs: Sequence[Pair], bank: str, baselines: Mapping[str, Mapping[str, Short]]
) -> Published:
    """Everything that is published."""
    protocol = protocol_of(pairs)
    rows = (*table(pairs), exact_law_row(pairs), *other_days(pairs))
    counted = [p for p in pairs if p.truth.kind != "differs"]
    return Published(
        bank=bank,
        cases=len(pairs),
        answered=sum(p.said is not ABSENT for p in pairs),
        table=[with_goal(row, protocol) for row in rows],
        by_strength=by_strength(pairs),
        calibration=calibration(counted)[1],
        confusion=confusion(counted),
        baselines=baseline_rows(pairs, baselines),
        mistakes=mistakes(pairs),
        model_against_bench=[
            Compared(p.case, sorted(p.truth.names), p.said.outcome, said(p.said), p.said.budget)
            for p in of_kind(pairs, "differs")
        ],
        trusted=trusted(pairs),
    )
