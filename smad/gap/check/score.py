"""Scores: verdicts against the key, every row of the published table with its interval."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import msgspec

from smad.gap.check.errors import KeyMismatchError, VerdictError
from smad.gap.check.goals import GOALS, Protocol
from smad.gap.check.intervals import bootstrap, wilson
from smad.gap.check.key import STRENGTHS, CaseKey, Key
from smad.gap.check.names import NAMING, SILENT
from smad.gap.check.verdicts import NO_CAUSES, CaseVerdict, Short, VerdictFile

CALIBRATION_BINS = 10
ABSENT = CaseVerdict(outcome="not_enough_excitation")
_LEAST_SHRINK = 0.05


class Row(msgspec.Struct, frozen=True):
    """One score: value and 95 % interval over `count` cases, all None without a case.

    `goal` is empty and `met` None where no goal applies; `bound` is the goal's.
    """

    name: str
    value: float | None
    low: float | None
    high: float | None
    count: int
    goal: str = ""
    met: bool | None = None
    bound: float | None = None


@dataclass(frozen=True)
class Pair:
    """A case: what is true of it, and what was said."""

    case: str
    truth: CaseKey
    said: CaseVerdict


def matched(
    file: VerdictFile, key: Key, key_sha256: str, *, answered_only: bool = False
) -> list[Pair]:
    """Answers with their verdicts; a case without one counts as not enough excitation.

    With `answered_only` it is left out instead: for a check of a part of a bank (`--cases`), which
    is drawn without the key.

    Raises KeyMismatchError when the verdicts were given on a bank with another key, VerdictError
    when they speak of cases that the key does not have.
    """
    if file.key_sha256 != key_sha256:
        raise KeyMismatchError(
            "the verdicts are on a bank with another key",
            value=f"{file.key_sha256[:12] or 'none'}…",
            limit=f"{key_sha256[:12]}…, this key's SHA-256",
            action="score them with the key of their own bank",
        )
    strangers = sorted(set(file.verdicts) - set(key.cases))
    if strangers:
        raise VerdictError(
            "there are verdicts on cases that the key does not have",
            value=", ".join(strangers[:3]),
            action="remove them",
        )
    return [
        Pair(c, truth, file.verdicts.get(c, ABSENT))
        for c, truth in key.cases.items()
        if c in file.verdicts or not answered_only
    ]


def of_kind(pairs: Iterable[Pair], *kinds: str) -> list[Pair]:
    """The pairs of some kinds."""
    return [p for p in pairs if p.truth.kind in kinds]


def detected(verdict: CaseVerdict | Short) -> bool:
    """Whether a verdict claims a structural gap."""
    return verdict.outcome not in SILENT


def name_credit(p: Pair) -> float:
    """1 for the right name first; 1/size for an ambiguity group that holds it; else 0."""
    if p.said.outcome not in NAMING:
        return 0.0
    group = set(p.said.group)
    if len(group) > 1:
        return 1.0 / len(group) if p.truth.names <= group else 0.0
    return 1.0 if frozenset(p.said.first) == p.truth.names else 0.0


def in_first_three(p: Pair) -> bool:
    """Whether one of the first three hypotheses holds the whole truth."""
    return any(p.truth.names <= set(h.names) for h in p.said.causes[:3])


def probability_of_truth(p: Pair) -> float:
    """Probability that the verdict gives to the truth."""
    want = p.truth.right_answer
    return sum(h.probability for h in p.said.causes if frozenset(h.names) == want)


class Bin(msgspec.Struct, frozen=True):
    """Cases whose first probability fell into one bin: the mean of it, and the share right."""

    said: float
    was: float
    count: int


def calibration(pairs: Sequence[Pair]) -> tuple[float | None, list[Bin]]:
    """Expected calibration error of the first hypothesis, and its bins (Guo et al. 2017)."""
    bins: list[list[tuple[float, float]]] = [[] for _ in range(CALIBRATION_BINS)]
    for p in pairs:
        if not p.said.causes:
            continue
        top = p.said.causes[0]
        hit = float(frozenset(top.names) == p.truth.right_answer)
        at = min(int(top.probability * CALIBRATION_BINS), CALIBRATION_BINS - 1)
        bins[at].append((top.probability, hit))
    total = sum(len(b) for b in bins)
    out = [
        Bin(statistics.fmean(p for p, _ in b), statistics.fmean(h for _, h in b), len(b))
        for b in bins
        if b
    ]
    error = sum(b.count / total * abs(b.said - b.was) for b in out) if total else None
    return error, out


def share(name: str, hits: Sequence[float]) -> Row:
    """A row for a share of cases, with Wilson's interval."""
    if not hits:
        return Row(name, None, None, None, 0)
    return Row(name, sum(hits) / len(hits), *wilson(sum(hits), len(hits)), len(hits))


def _over(name: str, values: Sequence[float], of: Callable[[Sequence[float]], float]) -> Row:
    """A row for a mean or a median, with its bootstrap interval."""
    if not values:
        return Row(name, None, None, None, 0)
    return Row(name, of(values), *bootstrap(values, of), len(values))


def with_goal(row: Row, protocol: Protocol, name: str = "") -> Row:
    """The row with the goal that `name` (the row's own by default) has under the protocol."""
    goal = GOALS.get(name or row.name, {}).get(protocol)
    if goal is None:
        return row
    met = None if row.value is None or row.low is None else goal.met(row.value, row.low)
    return msgspec.structs.replace(row, goal=str(goal), met=met, bound=goal.bound)


def _naming_rows(pairs: Sequence[Pair]) -> list[Row]:
    found = [p for p in of_kind(pairs, "single") if detected(p.said)]
    unknown = of_kind(pairs, "unknown")
    seen = [p for p in unknown if detected(p.said)]
    return [
        share("right name first, of the detected", [name_credit(p) for p in found]),
        share("right subsystem, of the detected",
              [float(p.said.subsystem in p.truth.subsystems) for p in found]),
        share("right name in the first three", [float(in_first_three(p)) for p in found]),
        _over("mean probability on the truth", [probability_of_truth(p) for p in found],
              statistics.fmean),
        share("unknown effects rejected, of the detected",
              [float(p.said.outcome == "unknown") for p in seen]),
        share("unknown effects named as a known one",
              [float(p.said.outcome in NAMING) for p in unknown]),
        share("unknown effects: right subsystem, of the detected",
              [float(p.said.subsystem in p.truth.subsystems) for p in seen]),
    ]  # fmt: skip


def _several_rows(pairs: Sequence[Pair]) -> list[Row]:
    def exact(kind: str) -> list[float]:
        return [float(frozenset(p.said.first) == p.truth.names) for p in of_kind(pairs, kind)]

    left_out = [
        float(p.said.left_out[name].outcome == "unknown")
        for p in of_kind(pairs, "single")
        for name in p.truth.names
        if name in p.said.left_out
    ]
    # Where no cause of the list is at work there is no name that an experiment could bring.
    followed = [
        float(frozenset(after) == p.truth.names)
        for p in of_kind(pairs, "single", "pair", "triple")
        if p.said.next_experiment is not None
        and (after := p.said.next_experiment.names_after) is not None
    ]
    return [
        share("leave one effect out: rejected", left_out),
        share("pairs: exact", exact("pair")),
        share("triples: exact", exact("triple")),
        share("recommended experiment resolves", followed),
    ]


def _shrink_rows(pairs: Sequence[Pair]) -> list[Row]:
    best_entry, exact_law, covered = [], [], []
    for p in of_kind(pairs, "single"):
        if detected(p.said) and p.said.shrink is not None:
            best, exact = p.said.shrink_best_entry, p.truth.shrink_exact_law
            if best is not None and best > _LEAST_SHRINK:
                best_entry.append(p.said.shrink / best)
            if exact is not None and exact > _LEAST_SHRINK:
                exact_law.append(p.said.shrink / exact)
        for e in p.truth.effects:
            q = p.said.quantities.get(e.name)
            if q is not None and e.quantity is not None:
                covered.append(float(q.low <= e.quantity <= q.high))
    return [
        _over("median held-out shrink, tool ÷ O2", best_entry, statistics.median),
        _over("median held-out shrink, tool ÷ O1", exact_law, statistics.median),
        share("95 % intervals cover", covered),
    ]


def _differs_rows(pairs: Sequence[Pair]) -> list[Row]:
    """Without known-good runs the causes of the budget are the answer, the first before all."""
    asked = [p for p in of_kind(pairs, "differs") if p.truth.effects]
    told = [[n for n in p.said.budget if n not in NO_CAUSES] for p in asked]
    first = [
        float(set(t[:1]) <= p.truth.names and bool(t)) for t, p in zip(told, asked, strict=True)
    ]
    among = [float(p.truth.names <= set(t)) for t, p in zip(told, asked, strict=True)]
    return [
        share("differs: right entry first in the budget", first),
        share("differs: right entry in the budget", among),
    ]


def _calibration_row(pairs: Sequence[Pair]) -> Row:
    counted = [p for p in pairs if p.said.causes and p.truth.kind != "differs"]
    error, bins = calibration(counted)
    if error is None:
        return Row("calibration error", None, None, None, 0)
    low, high = bootstrap(counted, lambda some: calibration(some)[0] or 0.0)
    count = sum(b.count for b in bins)
    return Row("calibration error", error, low, high, count)


def protocol_of(pairs: Sequence[Pair]) -> Protocol:
    """How the bank was recorded: a check-up's key tells what differs over paired repeats."""
    return "check-up" if any(p.truth.gap_paired for p in pairs) else "any runs"


def table(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the published table, and a few beside it, with the goals of the protocol."""
    quiet = of_kind(pairs, "none", "parameters")
    with_gap = of_kind(pairs, "single", "unknown")
    rows = [share("false alarms on none", [float(detected(p.said)) for p in quiet])]
    for strength in STRENGTHS:
        hits = [float(detected(p.said)) for p in with_gap if p.truth.strength == strength]
        rows.append(share(f"detected at {strength:.0f}× the floor", hits))
    rows += _naming_rows(pairs)
    rows.append(_calibration_row(pairs))
    rows += _several_rows(pairs) + _shrink_rows(pairs)
    rows += _differs_rows(pairs)
    protocol = protocol_of(pairs)
    return [with_goal(row, protocol) for row in rows]


def by_strength(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """The main scores apart for 1, 3 and 10 floors."""
    out: dict[str, list[Row]] = {"detected": [], "right name first": [], "unknown rejected": []}
    for strength in STRENGTHS:
        here = [p for p in pairs if p.truth.strength == strength]
        single, unknown = of_kind(here, "single"), of_kind(here, "unknown")
        label = f"{strength:.0f}×"
        seen = [float(detected(p.said)) for p in single + unknown]
        row = share(label, seen)
        goal = f"detected at {label} the floor"
        out["detected"].append(with_goal(row, protocol_of(pairs), goal))
        named = [name_credit(p) for p in single if detected(p.said)]
        out["right name first"].append(share(label, named))
        rejected = [float(p.said.outcome == "unknown") for p in unknown if detected(p.said)]
        out["unknown rejected"].append(share(label, rejected))
    return out
