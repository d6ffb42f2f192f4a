"""Scores: verdicts against the key, every row of the published table with its interval."""

import math
import statistics
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tests.withheld.errors import KeyMismatchError, VerdictError
from tests.withheld.intervals import bootstrap, wilson
from tests.withheld.verdicts import Short, Verdict, VerdictFile
from tests.withheld.vocabulary import NAMING, SILENT

CALIBRATION_BINS = 10
ABSENT = Verdict(outcome="not_enough_excitation")


@dataclass(frozen=True)
class Answer:
    """What is true of one case."""

    case: str
    kind: str
    names: frozenset[str]
    subsystems: frozenset[str]
    strength: float
    gap: float
    quantities: dict[str, float]
    shrink_exact_law: float | None


@dataclass(frozen=True)
class Row:
    """One score: value and 95 % interval over `count` cases; `met` None where no goal applies."""

    name: str
    value: float
    low: float
    high: float
    count: int
    goal: str = ""
    met: bool | None = None


Pair = tuple[Answer, Verdict]


def answers(key: dict[str, Any]) -> dict[str, Answer]:
    """The key's cases; the strength is the nearest of 1, 3, 10 to the gap really reached."""
    out = {}
    for case, entry in key["cases"].items():
        effects = entry["effects"]
        gap = float(entry["gap_worst"])
        nearest = min((1.0, 3.0, 10.0), key=lambda s: abs(math.log(max(gap, 1e-3) / s)))
        out[case] = Answer(
            case,
            entry["kind"],
            frozenset(e["name"] for e in effects),
            frozenset(e["subsystem"] for e in effects),
            nearest if effects else 0.0,
            gap,
            {e["name"]: e["quantity"] for e in effects if e["quantity"] is not None},
            entry.get("shrink_exact_law"),
        )
    return out


def matched(file: VerdictFile, key: dict[str, Any], key_sha256: str) -> list[Pair]:
    """Answers with their verdicts; a case without one counts as not enough excitation.

    Raises KeyMismatchError when the verdicts were given on a bank with another key, VerdictError
    when they speak of cases that the bank does not have.
    """
    if file.key_sha256 != key_sha256:
        raise KeyMismatchError(
            f"the verdicts are on a bank whose key is {file.key_sha256[:12]}…, this key is "
            f"{key_sha256[:12]}…: score them with the key of their own bank"
        )
    truth = answers(key)
    strangers = sorted(set(file.verdicts) - set(truth))
    if strangers:
        raise VerdictError(f"verdicts on {strangers[:3]} which the key does not have; remove them")
    return [(a, file.verdicts.get(case, ABSENT)) for case, a in truth.items()]


def of_kind(pairs: Iterable[Pair], *kinds: str) -> list[Pair]:
    """The pairs of some kinds."""
    return [p for p in pairs if p[0].kind in kinds]


def detected(verdict: Verdict | Short) -> bool:
    """Whether a verdict claims a structural gap."""
    return verdict.outcome not in SILENT


def name_credit(answer: Answer, verdict: Verdict) -> float:
    """1 for the right name first; 1/size for an ambiguity group that holds it; else 0."""
    if verdict.outcome not in NAMING:
        return 0.0
    group = set(verdict.group)
    if len(group) > 1:
        return 1.0 / len(group) if answer.names <= group else 0.0
    return 1.0 if frozenset(verdict.first) == answer.names else 0.0


def in_first_three(answer: Answer, verdict: Verdict) -> bool:
    """Whether one of the first three hypotheses holds the whole truth."""
    return any(answer.names <= set(h.names) for h in verdict.causes[:3])


def right_answer(answer: Answer) -> frozenset[str]:
    """What the first hypothesis should say, the answers that name no cause included."""
    special = {"none": "none", "parameters": "parameters", "unknown": "unknown"}
    return frozenset((special[answer.kind],)) if answer.kind in special else answer.names


def probability_of_truth(answer: Answer, verdict: Verdict) -> float:
    """Probability that the verdict gives to the truth."""
    want = right_answer(answer)
    return sum(h.probability for h in verdict.causes if frozenset(h.names) == want)


def calibration(pairs: Sequence[Pair]) -> tuple[float, list[dict[str, float]]]:
    """Expected calibration error of the first hypothesis, and its bins (Guo et al. 2017)."""
    bins: list[list[tuple[float, float]]] = [[] for _ in range(CALIBRATION_BINS)]
    for answer, verdict in pairs:
        if not verdict.causes:
            continue
        top = verdict.causes[0]
        hit = float(frozenset(top.names) == right_answer(answer))
        at = min(int(top.probability * CALIBRATION_BINS), CALIBRATION_BINS - 1)
        bins[at].append((top.probability, hit))
    total = sum(len(b) for b in bins)
    error, out = 0.0, []
    for inside in bins:
        if inside:
            said = statistics.fmean(p for p, _ in inside)
            was = statistics.fmean(h for _, h in inside)
            error += len(inside) / total * abs(said - was)
            out.append({"said": said, "was": was, "count": float(len(inside))})
    return (error if total else math.nan), out


def _share(name: str, hits: Sequence[float], goal: str = "", bound: float | None = None,
           *, at_most: bool = False, wilson_low: float | None = None) -> Row:  # fmt: skip
    count, total = len(hits), sum(hits)
    low, high = wilson(total, count)
    value = total / count if count else math.nan
    met: bool | None = None
    if bound is not None and count:
        met = value <= bound if at_most else value >= bound
        if wilson_low is not None:
            met = met and low >= wilson_low
    return Row(name, value, low, high, count, goal, met)


def _middle(name: str, values: Sequence[float], goal: str = "", bound: float | None = None) -> Row:
    if not values:
        return Row(name, math.nan, math.nan, math.nan, 0, goal, None)
    low, high = bootstrap(list(values), lambda v: statistics.median(float(str(x)) for x in v))
    value = statistics.median(values)
    return Row(name, value, low, high, len(values), goal, None if bound is None else value >= bound)


def _mean(name: str, values: Sequence[float], goal: str, bound: float) -> Row:
    if not values:
        return Row(name, math.nan, math.nan, math.nan, 0, goal, None)
    low, high = bootstrap(list(values), lambda v: statistics.fmean(float(str(x)) for x in v))
    value = statistics.fmean(values)
    return Row(name, value, low, high, len(values), goal, value >= bound)


def _naming_rows(pairs: Sequence[Pair]) -> list[Row]:
    single = of_kind(pairs, "single")
    found = [p for p in single if detected(p[1])]
    unknown = of_kind(pairs, "unknown")
    seen = [p for p in unknown if detected(p[1])]
    return [
        _share("right name first, of the detected", [name_credit(a, v) for a, v in found],
               "≥ 90 %, Wilson lower bound ≥ 85 %", 0.90, wilson_low=0.85),
        _share("right subsystem, of the detected",
               [float(v.subsystem in a.subsystems) for a, v in found], "≥ 97 %", 0.97),
        _share("right name in the first three", [float(in_first_three(a, v)) for a, v in found],
               "≥ 98 %", 0.98),
        _mean("mean probability on the truth", [probability_of_truth(a, v) for a, v in found],
              "≥ 0.85", 0.85),
        _share("unknown effects rejected, of the detected",
               [float(v.outcome == "unknown") for _, v in seen], "≥ 90 %", 0.90),
        _share("unknown effects named as a known one",
               [float(v.outcome in NAMING) for _, v in unknown], "≤ 5 %", 0.05, at_most=True),
        _share("unknown effects: right subsystem, of the detected",
               [float(v.subsystem in a.subsystems) for a, v in seen]),
    ]  # fmt: skip


def _several_rows(pairs: Sequence[Pair]) -> list[Row]:
    def exact(kind: str) -> list[float]:
        return [float(frozenset(v.first) == a.names) for a, v in of_kind(pairs, kind)]

    left_out = [
        float(v.left_out[name].outcome == "unknown")
        for a, v in of_kind(pairs, "single")
        for name in a.names
        if name in v.left_out
    ]
    followed = [
        float(frozenset(v.next_experiment.names_after) == a.names)
        for a, v in pairs
        if v.next_experiment is not None and v.next_experiment.names_after is not None
    ]
    return [
        _share("leave one effect out: rejected", left_out, "≥ 85 %", 0.85),
        _share("pairs: exact", exact("pair"), "≥ 75 %", 0.75),
        _share("triples: exact", exact("triple")),
        _share("recommended experiment resolves", followed, "≥ 80 % in one", 0.80),
    ]


def _shrink_rows(pairs: Sequence[Pair]) -> list[Row]:
    best_entry, exact_law = [], []
    for a, v in of_kind(pairs, "single"):
        if not detected(v) or v.shrink is None:
            continue
        if v.shrink_best_entry is not None and v.shrink_best_entry > 0.05:
            best_entry.append(v.shrink / v.shrink_best_entry)
        if a.shrink_exact_law is not None and a.shrink_exact_law > 0.05:
            exact_law.append(v.shrink / a.shrink_exact_law)
    covered = [
        float(q.low <= a.quantities[name] <= q.high)
        for a, v in of_kind(pairs, "single")
        for name, q in v.quantities.items()
        if name in a.quantities
    ]
    row = _share("95 % intervals cover", covered, "90–98 %")
    met = 0.90 <= row.value <= 0.98 if covered else None
    return [
        _middle("median held-out shrink, tool ÷ O2", best_entry, "≥ 0.90", 0.90),
        _middle("median held-out shrink, tool ÷ O1", exact_law),
        Row(row.name, row.value, row.low, row.high, row.count, row.goal, met),
    ]


def table(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the published table, and a few beside it."""
    quiet = of_kind(pairs, "none", "parameters")
    with_gap = of_kind(pairs, "single", "unknown")
    rows = [
        _share("false alarms on none", [float(detected(v)) for _, v in quiet],
               "≤ 1 in 60", 1 / 60, at_most=True),
    ]  # fmt: skip
    for strength, goal, bound in ((1.0, "", None), (3.0, "≥ 95 %", 0.95), (10.0, "≥ 99 %", 0.99)):
        hits = [float(detected(v)) for a, v in with_gap if a.strength == strength]
        rows.append(_share(f"detected at {strength:.0f}× the floor", hits, goal, bound))
    error, bins = calibration([p for p in pairs if p[0].kind != "differs"])
    rows += _naming_rows(pairs)
    count = int(sum(b["count"] for b in bins))
    said = [p for p in pairs if p[1].causes and p[0].kind != "differs"]
    low, high = bootstrap(said, lambda some: calibration(some)[0])  # type: ignore[arg-type]
    met = error <= 0.05 if count else None
    rows.append(Row("calibration error", error, low, high, count, "≤ 0.05", met))
    return rows + _several_rows(pairs) + _shrink_rows(pairs)


def by_strength(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """The main scores apart for 1, 3 and 10 floors."""
    out: dict[str, list[Row]] = {"detected": [], "right name first": [], "unknown rejected": []}
    for strength in (1.0, 3.0, 10.0):
        here = [p for p in pairs if p[0].strength == strength]
        single, unknown = of_kind(here, "single"), of_kind(here, "unknown")
        label = f"{strength:.0f}×"
        out["detected"].append(_share(label, [float(detected(v)) for _, v in single + unknown]))
        named = [name_credit(a, v) for a, v in single if detected(v)]
        out["right name first"].append(_share(label, named))
        rejected = [float(v.outcome == "unknown") for _, v in unknown if detected(v)]
        out["unknown rejected"].append(_share(label, rejected))
    return out


def said(verdict: Verdict | Short) -> str:
    """One word for what a verdict says, for the confusion matrix."""
    if verdict.outcome not in NAMING:
        return verdict.outcome
    first = verdict.first if isinstance(verdict, Verdict) else tuple(sorted(verdict.names))
    return " + ".join(first) or verdict.outcome


def confusion(pairs: Sequence[Pair]) -> dict[str, dict[str, int]]:
    """Truth → what was said → how often."""
    counts: dict[str, Counter[str]] = {}
    for answer, verdict in pairs:
        truth = " + ".join(sorted(answer.names)) or answer.kind
        truth = f"unknown: {truth}" if answer.kind == "unknown" else truth
        counts.setdefault(truth, Counter())[said(verdict)] += 1
    return {truth: dict(c.most_common()) for truth, c in sorted(counts.items())}


def baselines(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """The same main scores for every baseline that the verdicts carry."""
    names = sorted({name for _, v in pairs for name in v.baselines})
    out: dict[str, list[Row]] = {}
    for name in names:
        have = [(a, v.baselines[name]) for a, v in pairs if name in v.baselines]
        quiet = [s for a, s in have if a.kind in ("none", "parameters")]
        single = [(a, s) for a, s in have if a.kind == "single"]
        unknown = [s for a, s in have if a.kind == "unknown"]
        right = [
            float(frozenset(s.names) == a.names and s.outcome in NAMING)
            for a, s in single
            if detected(s)
        ]
        out[name] = [
            _share("false alarms on none", [float(detected(s)) for s in quiet]),
            _share("detected", [float(detected(s)) for _, s in single]),
            _share("right name first, of the detected", right),
            _share("unknown effects rejected", [float(s.outcome == "unknown") for s in unknown]),
        ]
    return out


def worst(pairs: Sequence[Pair], count: int = 10) -> list[dict[str, Any]]:
    """The wrong first answers that were given with the most confidence."""
    wrong = [
        (v.causes[0].probability, a, v)
        for a, v in pairs
        if v.causes and a.kind != "differs" and frozenset(v.causes[0].names) != right_answer(a)
    ]
    wrong.sort(key=lambda w: -w[0])
    return [
        {
            "case": a.case,
            "kind": a.kind,
            "truth": sorted(right_answer(a)),
            "floors": round(a.gap, 2),
            "said": list(v.causes[0].names),
            "outcome": v.outcome,
            "probability": p,
        }
        for p, a, v in wrong[:count]
    ]


def report(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Everything that is scored, as plain data."""
    error, bins = calibration([p for p in pairs if p[0].kind != "differs"])
    differs = of_kind(pairs, "differs")
    return {
        "cases": len(pairs),
        "answered": sum(v is not ABSENT for _, v in pairs),
        "table": [asdict(r) for r in table(pairs)],
        "by_strength": {n: [asdict(r) for r in rows] for n, rows in by_strength(pairs).items()},
        "calibration": {"error": error, "bins": bins},
        "confusion": confusion(pairs),
        "baselines": {n: [asdict(r) for r in rows] for n, rows in baselines(pairs).items()},
        "worst": worst(pairs),
        "model_against_bench": [
            {"case": a.case, "outcome": v.outcome, "subsystem": v.subsystem, "said": said(v)}
            for a, v in differs
        ],
    }
