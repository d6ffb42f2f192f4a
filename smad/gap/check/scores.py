"""Everything that is scored, as one record that goes to JSON as it is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from smad.gap.check.errors import CheckError, VerdictError
from smad.gap.check.names import NAMING
from smad.gap.check.score import (
    ABSENT,
    Bin,
    Pair,
    Row,
    by_strength,
    calibration,
    detected,
    of_kind,
    share,
    table,
)
from smad.gap.check.verdicts import CaseVerdict, Short

OURS = "the diagnosis"


class Mistake(msgspec.Struct, frozen=True):
    """A wrong first answer, with the probability it was given with."""

    case: str
    kind: str
    truth: list[str]
    floors: float
    said: list[str]
    outcome: str
    probability: float


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


class Scores(msgspec.Struct, frozen=True):
    """All scores of one verdict file.

    `confusion` is truth → what was said → cases. `baselines` holds the same rows for the diagnosis
    itself and for every baseline that the verdicts carry, on the cases that carry it.
    """

    bank: str
    cases: int
    answered: int
    table: list[Row]
    by_strength: dict[str, list[Row]]
    calibration: list[Bin]
    confusion: dict[str, dict[str, int]]
    baselines: dict[str, list[Row]]
    mistakes: list[Mistake]
    model_against_bench: list[Compared]
    trusted: list[Trusted] = []

    def to_json(self) -> bytes:
        """Indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n"


def write_scores(path: Path, found: Scores) -> None:
    """Writes the scores as JSON. Raises CheckError when the file cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(found.to_json())
    except OSError as error:
        raise CheckError(
            f"{path} cannot be written",
            value=error.strerror,
            action="choose another file with --json",
        ) from error


def read_scores(path: Path) -> Scores:
    """What `to_json` wrote. Raises VerdictError when the file is not that."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Scores)
    except (OSError, msgspec.DecodeError, msgspec.ValidationError) as error:
        raise VerdictError(
            f"{path} is not a file of scores",
            value=str(error),
            action="make one with smad gap score … --json",
        ) from error


def said(verdict: CaseVerdict | Short) -> str:
    """One word for what a verdict says, for the confusion matrix."""
    if verdict.outcome not in NAMING:
        return verdict.outcome
    first = verdict.first if isinstance(verdict, CaseVerdict) else tuple(sorted(verdict.names))
    return " + ".join(first) or verdict.outcome


def confusion(pairs: Sequence[Pair]) -> dict[str, dict[str, int]]:
    """Truth → what was said → how often."""
    counts: dict[str, Counter[str]] = {}
    for p in pairs:
        truth = " + ".join(sorted(p.truth.names)) or p.truth.kind
        truth = f"unknown: {truth}" if p.truth.kind == "unknown" else truth
        counts.setdefault(truth, Counter())[said(p.said)] += 1
    return {truth: dict(c.most_common()) for truth, c in sorted(counts.items())}


def baselines(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """The main scores of the diagnosis and of every baseline, by the same simple count.

    A group counts by its first name here, since baselines have none.
    """
    names = sorted({name for p in pairs for name in p.said.baselines})
    if not names:
        return {}
    have = [p for p in pairs if p.said.baselines]
    ours = [(p, Short(p.said.outcome, list(p.said.first))) for p in have]
    out = {OURS: _short_rows(ours)}
    for name in names:
        theirs = [(p, p.said.baselines[name]) for p in pairs if name in p.said.baselines]
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


def mistakes(pairs: Sequence[Pair]) -> list[Mistake]:
    """Every wrong first answer, the most confident first."""
    wrong = [
        Mistake(
            p.case,
            p.truth.kind,
            sorted(p.truth.right_answer),
            round(p.truth.gap_worst, 2),
            list(p.said.causes[0].names),
            p.said.outcome,
            p.said.causes[0].probability,
        )
        for p in pairs
        if p.said.causes
        and p.truth.kind != "differs"
        and frozenset(p.said.causes[0].names) != p.truth.right_answer
    ]
    return sorted(wrong, key=lambda m: (-m.probability, m.case))


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


def scores(pairs: Sequence[Pair], bank: str) -> Scores:
    """Everything that is scored."""
    return Scores(
        bank=bank,
        cases=len(pairs),
        answered=sum(p.said is not ABSENT for p in pairs),
        table=table(pairs),
        by_strength=by_strength(pairs),
        calibration=calibration([p for p in pairs if p.truth.kind != "differs"])[1],
        confusion=confusion([p for p in pairs if p.truth.kind != "differs"]),
        baselines=baselines(pairs),
        mistakes=mistakes(pairs),
        model_against_bench=[
            Compared(p.case, sorted(p.truth.names), p.said.outcome, said(p.said), p.said.budget)
            for p in of_kind(pairs, "differs")
        ],
        trusted=trusted(pairs),
    )
