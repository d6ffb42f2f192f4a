"""Where, and what name: every row of the published table, from answers and keys alone."""

from __future__ import annotations

import random
import statistics
from collections.abc import Callable, Sequence
from itertools import permutations
from typing import TypeVar

from evaluation.names import canonical
from evaluation.score.answers import STRENGTHS, Cause, Pair
from evaluation.score.goals import GOALS, Row
from evaluation.score.intervals import wilson
from smad.diagnosis.verdict import DIFFERS
from smad.report.page import Table

_BINS = 5
_SEEN = 3.0
"""Least floors that each effect of a pair must change alone for the row of strong pairs."""
_OTHER_DAYS = ("room", "preload", "drift")
_FIRST_OWN = 4
_ROUNDING = 1e-6
_CHANCE_DRAWS = 500
"""So that the mean of the error is known to a hundredth."""
_SEED = 20261128

Test = Callable[[Pair], bool]
_Case = TypeVar("_Case")


def share(name: str, pairs: Sequence[_Case], holds: Callable[[_Case], float]) -> Row:
    """A row for a share of cases, with Wilson's interval."""
    if not pairs:
        return Row(name)
    hits, n = sum(float(holds(p)) for p in pairs), len(pairs)
    return Row(name, hits / n, *wilson(hits, n), n)


def _over(
    name: str, values: Sequence[float], of: Callable[[Sequence[float]], float] = statistics.median
) -> Row:
    return Row(name, of(values), None, None, len(values)) if values else Row(name)


def of_kind(pairs: Sequence[Pair], *kinds: str) -> list[Pair]:
    """The cases of some kinds."""
    return [p for p in pairs if p.truth.kind in kinds]


def _in_reported(p: Pair) -> bool:
    return bool(p.first.reported_places & p.true_places)


def _gone(pairs: Sequence[Pair]) -> list[float]:
    """Of cases whose gap is above the floor, what goes with what is reported."""
    shares = (p.said.whole.gone for p in pairs if p.said.whole is not None)
    return [x for x in shares if x is not None]


def _worse(p: Pair) -> bool:
    """What is reported leaves more of the judged runs than other parameters alone."""
    whole = p.said.whole
    return whole is not None and whole.final > whole.parameters + _ROUNDING


def _both_places(p: Pair) -> bool:
    """Each effect has a cause of its own: one at a place that both share is not both."""
    effects = p.truth.effects
    return any(
        all(c.place in e.places for c, e in zip(chosen, effects, strict=True))
        for chosen in permutations(p.said.causes[:3], len(effects))
    )


def _both_names(p: Pair) -> bool:
    return {canonical(c.reported_name) for c in p.said.causes} >= p.true_names


def _place_beside(p: Pair) -> bool:
    """A later cause is at a place where nothing acts."""
    return any(not c.reported_places & p.true_places for c in p.said.causes[1:])


def _added_among(p: Pair, first: int) -> bool:
    return any(c.place in p.true_places for c in p.said.causes[:first])


def _added_named(p: Pair) -> bool:
    """The first cause at the effect's place that is reported by name has the right one."""
    named = [c for c in p.said.causes if c.reported_name and c.place in p.true_places]
    return bool(named) and canonical(named[0].reported_name) in p.true_names


def _own_found(p: Pair) -> float:
    """Share of the plant's own differences, four at most, that the first four places hold."""
    places = {c.place for c in p.said.causes[:_FIRST_OWN]}
    hits = sum(bool(places & set(d.places)) for d in p.truth.differences)
    return min(hits / min(len(p.truth.differences), _FIRST_OWN), 1.0)


def _something_differs(p: Pair, cause: Cause) -> bool:
    """The added effect or one of the plant's own differences is at the place of a cause."""
    return cause.place in p.true_places.union(*(d.places for d in p.truth.differences))


Said = tuple[float, bool]
"""What was said to be how probable, and whether it was right."""


def said_of_places(pairs: Sequence[Pair]) -> list[Said]:
    """The first places with their probability."""
    return [(p.first.probability, p.placed) for p in pairs if p.first.place]


def said_of_names(pairs: Sequence[Pair]) -> list[Said]:
    """The likeliest effects with their probability."""
    return [(p.first.name_probability, p.likeliest_right) for p in pairs if p.first.names]


def _bin(probability: float) -> int:
    return min(int(probability * _BINS), _BINS - 1)


def _bins(claims: Sequence[Said]) -> list[list[Said]]:
    """What was said, by fifths of probability; those that have something."""
    bins: list[list[Said]] = [[] for _ in range(_BINS)]
    for claim in claims:
        bins[_bin(claim[0])].append(claim)
    return [b for b in bins if b]


def calibration(claims: Sequence[Said], weights: Sequence[float] | None = None) -> float:
    """Expected calibration error (Guo et al. 2017)."""
    if weights is None:
        weights = [1.0] * len(claims)
    apart = [0.0] * _BINS
    for (probability, right), weight in zip(claims, weights, strict=True):
        apart[_bin(probability)] += weight * (probability - right)
    return sum(map(abs, apart)) / sum(weights)


def calibration_of_equals(kinds: Sequence[Sequence[Said]]) -> float:
    """The error if each kind of case were as common as the others, as `calibrate` takes them."""
    weights = [1.0 / len(claims) for claims in kinds for _ in claims]
    return calibration([claim for claims in kinds for claim in claims], weights)


def calibration_by_chance(claims: Sequence[Said]) -> float:
    """The error that right probabilities show of so few cases, the mean over many draws."""
    rng = random.Random(_SEED)
    draws = (calibration([(p, rng.random() < p) for p, _ in claims]) for _ in range(_CHANCE_DRAWS))
    return statistics.fmean(draws)


def reliability(claims: Sequence[Said]) -> list[tuple[str, ...]]:
    """The reliability diagram as rows: what was said, how often it was right."""
    return [
        (
            f"{statistics.fmean(x for x, _ in b):.2f}",
            number(share("", b, lambda claim: claim[1])),
            str(len(b)),
        )
        for b in _bins(claims)
    ]


def rows(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the cases of check-ups, or of what has changed."""
    effects = of_kind(pairs, "single", "unknown")
    noticed = [p for p in effects if p.noticed]
    listed, unlisted = of_kind(noticed, "single"), of_kind(noticed, "unknown")
    several = of_kind(pairs, "pair")
    both = [p for p in several if all(e.gap_alone >= _SEEN for e in p.truth.effects)]
    left_out = [p for p in of_kind(pairs, "single") if p.said.left_out]
    kinds = (("listed", listed), ("unlisted", unlisted))
    out = [
        share(
            "quiet benches called changed",
            of_kind(pairs, "none"),
            lambda p: p.said.outcome not in ("quiet", "refused"),
        ),
        share(
            "parameters given a cause", of_kind(pairs, "parameters"), lambda p: bool(p.said.causes)
        ),
        *(
            share(
                f"called changed on another day: {kind}",
                days,
                lambda p: p.said.outcome not in ("quiet", "refused"),
            )
            for kind in _OTHER_DAYS
            if (days := of_kind(pairs, kind))
        ),
        *(
            share(
                f"noticed near {s:.0f} floor{'s' if s > 1.0 else ''}",
                [p for p in effects if p.strength == s],
                lambda p: p.noticed,
            )
            for s in STRENGTHS
        ),
        *(share(f"place right first, {k}", part, lambda p: p.placed) for k, part in kinds),
        *(share(f"reported places hold the truth, {k}", part, _in_reported) for k, part in kinds),
        _over(
            "reported places, mean number",
            [len(p.first.reported_places) for p in noticed],
            statistics.fmean,
        ),
        share("right name first, of noticed listed", listed, lambda p: p.likeliest_right),
        share("right name reported, of noticed listed", listed, lambda p: p.named),
        share(
            "right name, of names reported",
            [p for p in noticed if p.first.reported_name],
            lambda p: p.named,
        ),
        share("unlisted reported by name", unlisted, lambda p: bool(p.first.reported_name)),
        *(_over(f"gap gone, {k}", _gone(part)) for k, part in kinds),
        share("held-out gap above that of parameters alone", pairs, _worse),
        share("pairs: both places among the first three", several, _both_places),
        share("pairs: both names reported", several, _both_names),
        share("pairs of three floors each: both places among the first three", both, _both_places),
        share("one effect: another place reported beside it", noticed, _place_beside),
        share(
            "left out: its place still reported",
            left_out,
            lambda p: any(set(s.places) & p.true_places for s in p.said.left_out.values()),
        ),
        share(
            "left out: reported by name all the same",
            left_out,
            lambda p: any(s.name for s in p.said.left_out.values()),
        ),
    ]
    for what, said_of in (("places", said_of_places), ("names", said_of_names)):
        claims, of_kinds = said_of(noticed), [said_of(part) for _, part in kinds]
        if all(of_kinds):
            name = f"error of the probabilities of {what}, as many listed as unlisted"
            out.append(Row(name, calibration_of_equals(of_kinds), count=len(claims)))
        if claims:
            out += [
                Row(name, error(claims), count=len(claims))
                for name, error in (
                    (f"error of the probabilities of {what}", calibration),
                    (f"error that right probabilities of {what} show", calibration_by_chance),
                )
            ]
    return out + _time(pairs)


def rows_of_differs(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the cases without good runs."""
    added = [p for p in pairs if p.truth.effects]
    gaps = [p.said.whole for p in pairs if p.said.whole is not None]
    return [
        share("added effect's place among the first three", added, lambda p: _added_among(p, 3)),
        share(
            "added effect's entry named first at its place",
            [p for p in added if p.truth.effects[0].known],
            _added_named,
        ),
        share("own differences among the first four places", pairs, _own_found),
        share(
            "causes reported where something differs",
            [(p, cause) for p in pairs for cause in p.said.causes],
            lambda reported: _something_differs(*reported),
        ),
        _over("floors left by parameters alone, median", [w.parameters for w in gaps]),
        _over("floors left with what is reported, median", [w.final for w in gaps]),
        share("held-out gap above that of parameters alone", pairs, _worse),
        *_time(pairs),
    ]


def _time(pairs: Sequence[Pair]) -> list[Row]:
    seconds = [p.said.seconds for p in pairs if p.said.seconds]
    return [
        _over("processor time, median", seconds),
        _over("processor time, longest", seconds, max),
    ]


def number(row: Row) -> str:
    """Value and interval, or a dash without cases."""
    if row.value is None:
        return "–"
    text = f"{row.value:.2f}"
    return text if row.low is None else f"{text} [{row.low:.2f}, {row.high:.2f}]"


def scored(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """Question → its rows."""
    by_question: dict[str, list[Pair]] = {}
    for p in pairs:
        by_question.setdefault(p.truth.question, []).append(p)
    return {
        question: rows_of_differs(part) if question == DIFFERS else rows(part)
        for question, part in by_question.items()
    }


def tables(pairs: Sequence[Pair]) -> dict[str, Table]:
    """Everything that is published, by heading."""
    out = {f"Scores, {question}": _scores(question, r) for question, r in scored(pairs).items()}
    changed = [p for p in pairs if p.truth.question != DIFFERS]
    out |= {
        "Over strength": _over_strength(changed),
        "Probability of the first place": _reliable(said_of_places(_reported_of(changed))),
        "Probability of the likeliest name": _reliable(said_of_names(_reported_of(changed))),
        "By likelihood alone: right name first, of noticed listed": _rules(changed),
        "Wrong or missed": _wrong(pairs),
    }
    return {heading: table for heading, table in out.items() if table.rows}


def _scores(question: str, score_rows: Sequence[Row]) -> Table:
    goals = GOALS[question]
    lines = []
    for row in score_rows:
        goal = goals.get(row.name)
        met = "" if goal is None or row.value is None else "yes" if goal.met(row.value) else "no"
        lines.append((row.name, number(row), str(row.count), str(goal or ""), met))
    head = ("score", "value [95 %]", "cases", "goal", "met")
    return Table(head, lines, numeric=frozenset({1, 2}))


def _reported_of(pairs: Sequence[Pair]) -> list[Pair]:
    return [p for p in of_kind(pairs, "single", "unknown") if p.noticed]


def _reliable(claims: Sequence[Said]) -> Table:
    head = ("said", "right [95 %]", "cases")
    return Table(head, reliability(claims), numeric=frozenset({0, 1, 2}))


def _over_strength(pairs: Sequence[Pair]) -> Table:
    """What is reported right of single effects near 1, 3 and 10 floors."""
    effects = of_kind(pairs, "single", "unknown")
    noticed = [p for p in effects if p.noticed]
    listed = of_kind(noticed, "single")
    curves: list[tuple[str, list[Pair], Test]] = [
        ("noticed", effects, lambda p: p.noticed),
        ("place right first", noticed, lambda p: p.placed),
        ("reported places hold the truth", noticed, _in_reported),
        ("right name first, listed", listed, lambda p: p.likeliest_right),
        ("right name reported, listed", listed, lambda p: p.named),
    ]
    lines = [
        (name, *(number(share("", [p for p in part if p.strength == s], holds)) for s in STRENGTHS))
        for name, part, holds in curves
    ]
    gone = [_over("", _gone([p for p in noticed if p.strength == s])) for s in STRENGTHS]
    lines.append(("gap gone", *map(number, gone)))
    head = ("of single effects", *(f"near {s:.0f}×" for s in STRENGTHS))
    return Table(head, lines if effects else [], numeric=frozenset(range(1, len(head))))


def _rules(pairs: Sequence[Pair]) -> Table:
    """Beside the diagnosis, the effect that leaves least, which is never silent."""
    listed = [p for p in of_kind(pairs, "single") if p.noticed and p.said.first_step]
    rules: list[tuple[str, Test]] = [
        ("the diagnosis", lambda p: p.likeliest_right),
        ("the least misfit", lambda p: canonical(p.said.least_misfit) in p.true_names),
    ]
    lines = [(rule, number(share("", listed, test))) for rule, test in rules] if listed else []
    return Table(("rule", "right name [95 %]"), lines, numeric=frozenset({1}))


def _wrong(pairs: Sequence[Pair]) -> Table:
    """Cases whose first place or silence is wrong, the strongest first."""

    def wrong(p: Pair) -> bool:
        if not p.truth.effects:
            return p.truth.question != DIFFERS and p.noticed
        return not (_added_among(p, 3) if p.truth.question == DIFFERS else p.noticed and p.placed)

    failed = sorted((p for p in pairs if wrong(p)), key=lambda p: -p.truth.gap_worst)
    lines = [
        (
            p.case,
            p.truth.kind,
            " + ".join(e.name for e in p.truth.effects),
            f"{p.truth.gap_worst:.1f}",
            p.said.outcome,
            ", ".join(f"{c.place} {c.reported_name}".strip() for c in p.said.causes[:3]),
        )
        for p in failed
    ]
    head = ("case", "kind", "truth", "floors", "outcome", "places reported")
    return Table(head, lines, numeric=frozenset({3}))
