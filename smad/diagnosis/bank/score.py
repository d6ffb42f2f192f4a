"""Scores: verdicts against the key, every row with its interval; what was said of what."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from smad.diagnosis.bank.errors import CheckError, KeyMismatchError, VerdictError
from smad.diagnosis.bank.intervals import T, bootstrap, wilson
from smad.diagnosis.bank.key import STRENGTHS, CaseKey, Key
from smad.diagnosis.bank.names import NAMING, OUTCOMES, SILENT
from smad.diagnosis.bank.verdicts import NO_CAUSES, CaseVerdict, Short, VerdictFile
from smad.gap.records import Outcome
from smad.report.page import Table, text_table

CALIBRATION_BINS = 10
ABSENT = CaseVerdict(outcome="not_enough_excitation")
_MOST_MISTAKES = 40


class Row(msgspec.Struct, frozen=True):
    """One score: value and 95 % interval over `count` cases, all None without a case."""

    name: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    count: int = 0


class Mistake(msgspec.Struct, frozen=True):
    """A wrong first answer, with the probability it was given with."""

    case: str
    kind: str
    truth: list[str]
    floors: float
    said: list[str]
    outcome: str
    probability: float


class Scores(msgspec.Struct, frozen=True):
    """All scores of one verdict file. `confusion` is truth → what was said → cases."""

    bank: str
    cases: int
    answered: int
    table: list[Row]
    confusion: dict[str, dict[str, int]]
    mistakes: list[Mistake]


@dataclass(frozen=True)
class Pair:
    """A case: what is true of it, and what was said."""

    case: str
    truth: CaseKey
    said: CaseVerdict

    @property
    def right(self) -> bool:
        """Whether the first hypothesis is the right answer."""
        return bool(self.said.causes) and set(self.said.causes[0].names) == self.truth.right_answer


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
        for top in p.said.causes[:1]:
            at = min(int(top.probability * CALIBRATION_BINS), CALIBRATION_BINS - 1)
            bins[at].append((top.probability, float(p.right)))
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
        return Row(name)
    return Row(name, sum(hits) / len(hits), *wilson(sum(hits), len(hits)), len(hits))


def over(name: str, values: Sequence[T], of: Callable[[Sequence[T]], float]) -> Row:
    """A row for a mean or another statistic, with its bootstrap interval."""
    if not values:
        return Row(name)
    return Row(name, of(values), *bootstrap(values, of), len(values))


def _naming_rows(pairs: Sequence[Pair]) -> list[Row]:
    found = [p for p in of_kind(pairs, "single") if detected(p.said)]
    unknown = of_kind(pairs, "unknown")
    seen = [p for p in unknown if detected(p.said)]
    return [
        share("right name first, of the detected", [name_credit(p) for p in found]),
        share("right subsystem, of the detected",
              [float(p.said.subsystem in p.truth.subsystems) for p in found]),
        share("right name in the first three", [float(in_first_three(p)) for p in found]),
        over("mean probability on the truth", [probability_of_truth(p) for p in found],
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
    covered = [
        float(q.low <= e.quantity <= q.high)
        for p in of_kind(pairs, "single")
        for e in p.truth.effects
        if (q := p.said.quantities.get(e.name)) is not None and e.quantity is not None
    ]
    return [
        share("leave one effect out: rejected", left_out),
        share("pairs: exact", exact("pair")),
        share("triples: exact", exact("triple")),
        share("95 % intervals cover", covered),
    ]


def _differs_rows(pairs: Sequence[Pair]) -> list[Row]:
    """Without known-good runs the causes of the budget are the answer, the first before all."""
    asked = [p for p in of_kind(pairs, "differs") if p.truth.effects]
    told = [[n for n in p.said.budget if n not in NO_CAUSES] for p in asked]
    truths = [p.truth.names for p in asked]
    first = [float(t[:1] != [] and t[0] in true) for t, true in zip(told, truths, strict=True)]
    among = [float(true <= set(t)) for t, true in zip(told, truths, strict=True)]
    return [
        share("differs: right entry first in the budget", first),
        share("differs: right entry in the budget", among),
    ]


def _answered(pairs: Sequence[Pair]) -> list[Pair]:
    """Cases with a first hypothesis; where the question is what differs, it is not the answer."""
    return [p for p in pairs if p.said.causes and p.truth.kind != "differs"]


def table(pairs: Sequence[Pair]) -> list[Row]:
    """Every row."""
    quiet = of_kind(pairs, "none", "parameters")
    with_gap = of_kind(pairs, "single", "unknown")
    # All runs of a case are of one state of one bench.
    apart = [float(p.said.outcome == OUTCOMES[Outcome.CONTRADICTING]) for p in pairs]
    rows = [
        share("false alarms on none", [float(detected(p.said)) for p in quiet]),
        share("runs of one state said to contradict each other", apart),
    ]
    for strength in STRENGTHS:
        hits = [float(detected(p.said)) for p in with_gap if p.truth.strength == strength]
        rows.append(share(f"detected at {strength:.0f}× the floor", hits))
    rows += _naming_rows(pairs)
    rows.append(
        over("calibration error", _answered(pairs), lambda some: calibration(some)[0] or 0.0)
    )
    return [*rows, *_several_rows(pairs), *_differs_rows(pairs)]


def said(verdict: CaseVerdict) -> str:
    """One word for what a verdict says, for the confusion matrix."""
    return (" + ".join(verdict.first) if verdict.outcome in NAMING else "") or verdict.outcome


def confusion(pairs: Sequence[Pair]) -> dict[str, dict[str, int]]:
    """Truth → what was said → how often."""
    counts: dict[str, Counter[str]] = {}
    for p in pairs:
        truth = " + ".join(sorted(p.truth.names)) or p.truth.kind
        truth = f"unknown: {truth}" if p.truth.kind == "unknown" else truth
        counts.setdefault(truth, Counter())[said(p.said)] += 1
    return {truth: dict(c.most_common()) for truth, c in sorted(counts.items())}


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
        for p in _answered(pairs)
        if not p.right
    ]
    return sorted(wrong, key=lambda m: (-m.probability, m.case))


def scores(pairs: Sequence[Pair], bank: str) -> Scores:
    """Everything that is scored."""
    return Scores(
        bank=bank,
        cases=len(pairs),
        answered=sum(p.said is not ABSENT for p in pairs),
        table=table(pairs),
        confusion=confusion([p for p in pairs if p.truth.kind != "differs"]),
        mistakes=mistakes(pairs),
    )


def write_scores(path: Path, found: msgspec.Struct) -> None:
    """Writes scores as indented JSON. Raises CheckError when the file cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")
    except OSError as error:
        raise CheckError(
            f"{path} cannot be written",
            value=error.strerror,
            action="choose another file with --json",
        ) from error


def number(row: Row) -> str:
    """Value and interval, or a dash without cases."""
    if row.value is None:
        return "–"
    low, high = (f"{v:.3f}" if v is not None else "–" for v in (row.low, row.high))
    return f"{row.value:.3f} [{low}, {high}]"


def mistakes_table(some: Sequence[Mistake]) -> Table:
    """Wrong first answers, a line each."""
    return Table(
        ("case", "kind", "truth", "floors", "outcome", "said", "probability"),
        [
            (m.case, m.kind, " + ".join(m.truth), f"{m.floors:.1f}", m.outcome,
             " + ".join(m.said), f"{m.probability:.2f}")
            for m in some
        ],
        numeric=frozenset({3, 6}),
    )  # fmt: skip


def text(found: Scores) -> str:
    """The scores for a terminal, and the wrong answers, the most confident first."""
    rows = [(r.name, number(r), str(r.count)) for r in found.table]
    parts = [
        f"{found.answered} of {found.cases} cases answered\n",
        text_table(Table(("score", "value [95 %]", "cases"), rows, numeric=frozenset({1, 2}))),
    ]
    if found.mistakes:
        few = found.mistakes[:_MOST_MISTAKES]
        parts += ["\nwrong first answers\n", text_table(mistakes_table(few))]
    return "\n".join(p.rstrip("\n") for p in parts)
