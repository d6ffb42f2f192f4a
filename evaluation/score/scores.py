"""Where, which law, what name: every row of the published table, from answers and keys alone."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import TypeVar

from evaluation.names import canonical
from evaluation.score.answers import DIFFERS, STRENGTHS, Pair
from evaluation.score.goals import GOALS, Row
from evaluation.score.intervals import wilson
from smad.report.page import Table

_BINS = 5
_OTHER_DAYS = ("room", "preload", "drift")
_FIRST_OWN = 4

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


def _in_told(p: Pair) -> bool:
    return bool(p.first.near & p.true_places)


def _side_right(p: Pair) -> bool:
    return any(p.first.place in e.places and p.first.side == e.side for e in p.truth.effects)


def _state_right(p: Pair) -> bool:
    return p.first.terms[0].of in {s for e in p.truth.effects for s in e.states}


def _has_law(p: Pair) -> bool:
    return p.placed and bool(p.first.terms)


def _sided(p: Pair) -> bool:
    """The place is right, and the model has it on either spring."""
    return p.placed and not p.first.place.startswith(_SHARED)


_SHARED = ("force_cell", "inlet_water", "ambient_air", "reading_inlet", "reading_ambient",
           "reading_displacement", "reading_force")  # fmt: skip
"""Places that both springs share."""


def _gone(pairs: Sequence[Pair]) -> list[float]:
    """Of cases whose gap is above the floor, what goes with the laws."""
    found = (p.said.whole.gone for p in pairs if p.said.whole is not None)
    return [x for x in found if x is not None]


def _both_places(p: Pair) -> bool:
    first = {q.place for q in p.said.places[:3]}
    return all(first & set(e.places) for e in p.truth.effects)


def _both_names(p: Pair) -> bool:
    return set(p.given) == {e.name for e in p.truth.effects}


def _added_among(p: Pair, first: int) -> bool:
    return any(q.place in p.true_places for q in p.said.places[:first])


def _added_named(p: Pair) -> bool:
    """The first place of the effect's that has a name has the right one."""
    named = [q for q in p.said.places if q.name and q.place in p.true_places]
    return bool(named) and canonical(named[0].name) == p.truth.effects[0].name


def _own_found(p: Pair) -> float:
    """Share of the plant's own differences, four at most, that the first four places hold."""
    told = {q.place for q in p.said.places[:_FIRST_OWN]}
    found = sum(bool(told & set(own.places)) for own in p.truth.own)
    return min(found / min(len(p.truth.own), _FIRST_OWN), 1.0)


Said = tuple[float, bool]
"""What was said to be how probable, and whether it was right."""


def said_of_places(pairs: Sequence[Pair]) -> list[Said]:
    """The first places with their probability."""
    return [(x, p.placed) for p in pairs if (x := p.first.probability) is not None]


def said_of_names(pairs: Sequence[Pair]) -> list[Said]:
    """The likeliest effects with their probability."""
    out = []
    for p in pairs:
        if p.first.names:
            name = max(p.first.names, key=lambda n: p.first.names[n])
            right = canonical(name) in {e.name for e in p.truth.effects}
            out.append((p.first.name_probability, right))
    return out


def _bins(said: Sequence[Said]) -> list[list[Said]]:
    """What was said, by fifths of probability; those that have something."""
    bins: list[list[Said]] = [[] for _ in range(_BINS)]
    for one in said:
        bins[min(int(one[0] * _BINS), _BINS - 1)].append(one)
    return [b for b in bins if b]


def calibration(said: Sequence[Said]) -> float:
    """Expected calibration error (Guo et al. 2017)."""
    apart = [
        len(b) * abs(statistics.fmean(x for x, _ in b) - statistics.fmean(right for _, right in b))
        for b in _bins(said)
    ]
    return sum(apart) / len(said)


def reliability(said: Sequence[Said]) -> list[tuple[str, ...]]:
    """The reliability diagram as rows: what was said, how often it was right."""
    return [
        (f"{statistics.fmean(x for x, _ in b):.2f}",
         number(share("", b, lambda one: one[1])), str(len(b)))
        for b in _bins(said)
    ]  # fmt: skip


def rows(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the cases of check-ups, or of what has changed."""
    effects = of_kind(pairs, "single", "unknown")
    noticed = [p for p in effects if p.noticed]
    listed, unlisted = of_kind(noticed, "single"), of_kind(noticed, "unknown")
    several = of_kind(pairs, "pair")
    left_out = [p for p in of_kind(pairs, "single") if p.said.left_out]
    of_places, of_names = said_of_places(noticed), said_of_names(noticed)
    kinds = (("listed", listed), ("unlisted", unlisted))
    out = [
        share("quiet benches called changed", of_kind(pairs, "none"),
              lambda p: p.said.outcome not in ("quiet", "refused")),
        share("parameters given a cause", of_kind(pairs, "parameters"),
              lambda p: bool(p.said.places)),
        *(share(f"called changed on another day: {kind}", days,
                lambda p: p.said.outcome not in ("quiet", "refused"))
          for kind in _OTHER_DAYS if (days := of_kind(pairs, kind))),
        *(share(f"noticed near {s:.0f} floor{'s' if s > 1.0 else ''}",
                [p for p in effects if p.strength == s], lambda p: p.noticed) for s in STRENGTHS),
        *(share(f"place right first, {k}", some, lambda p: p.placed) for k, some in kinds),
        *(share(f"told places hold the truth, {k}", some, _in_told) for k, some in kinds),
        _over("told places, mean number", [len(p.first.near) for p in noticed], statistics.fmean),
        share("side right", [p for p in noticed if _sided(p)], _side_right),
        share("first state right", [p for p in noticed if _has_law(p)], _state_right),
        share("right name, of noticed listed", listed, lambda p: p.named),
        share("right name, of names given", [p for p in noticed if p.first.name],
              lambda p: p.named),
        share("unlisted given a name", unlisted, lambda p: bool(p.first.name)),
        *(_over(f"gap gone with the laws, {k}", _gone(some)) for k, some in kinds),
        share("pairs: both places among the first three", several, _both_places),
        share("pairs: both names right", several, _both_names),
        share("left out: its place still told", left_out,
              lambda p: any(set(s.places) & p.true_places for s in p.said.left_out.values())),
    ]  # fmt: skip
    for what, said in (("places", of_places), ("names", of_names)):
        if said:
            row = Row(f"error of the probabilities of {what}", calibration(said), count=len(said))
            out.append(row)
    return out + _time(pairs)


def rows_of_differs(pairs: Sequence[Pair]) -> list[Row]:
    """Every row of the cases without good runs."""
    added = [p for p in pairs if p.truth.effects]
    return [
        share("added effect's place among the first three", added, lambda p: _added_among(p, 3)),
        share("added effect's entry named first at its place",
              [p for p in added if p.truth.effects[0].known], _added_named),
        share("own differences among the first four places", pairs, _own_found),
        *_time(pairs),
    ]  # fmt: skip


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
    told = f"{row.value:.2f}"
    return told if row.low is None else f"{told} [{row.low:.2f}, {row.high:.2f}]"


def scored(pairs: Sequence[Pair]) -> dict[str, list[Row]]:
    """Question → its rows."""
    by_question: dict[str, list[Pair]] = {}
    for p in pairs:
        by_question.setdefault(p.truth.question, []).append(p)
    return {
        question: rows_of_differs(some) if question == DIFFERS else rows(some)
        for question, some in by_question.items()
    }


def tables(pairs: Sequence[Pair]) -> dict[str, Table]:
    """Everything that is published, by heading."""
    out = {f"Scores, {question}": _scores(question, r) for question, r in scored(pairs).items()}
    known = [p for p in pairs if p.truth.question != DIFFERS]
    out |= {
        "Over strength": _over_strength(known),
        "Probability of the first place": _reliable(said_of_places(_told_of(known))),
        "Probability of the likeliest name": _reliable(said_of_names(_told_of(known))),
        "Simpler rules: right name, of noticed listed": _rules(known),
        "Wrong or missed": _wrong(pairs),
    }
    return {heading: table for heading, table in out.items() if table.rows}


def _scores(question: str, found: Sequence[Row]) -> Table:
    goals = GOALS[question]
    lines = []
    for row in found:
        goal = goals.get(row.name)
        met = "" if goal is None or row.value is None else "yes" if goal.met(row.value) else "no"
        lines.append((row.name, number(row), str(row.count), str(goal or ""), met))
    head = ("score", "value [95 %]", "cases", "goal", "met")
    return Table(head, lines, numeric=frozenset({1, 2}))


def _told_of(pairs: Sequence[Pair]) -> list[Pair]:
    return [p for p in of_kind(pairs, "single", "unknown") if p.noticed]


def _reliable(said: Sequence[Said]) -> Table:
    head = ("said", "right [95 %]", "cases")
    return Table(head, reliability(said), numeric=frozenset({0, 1, 2}))


def _over_strength(pairs: Sequence[Pair]) -> Table:
    """What is told right of single effects near 1, 3 and 10 floors."""
    effects = of_kind(pairs, "single", "unknown")
    found = [p for p in effects if p.noticed]
    listed = of_kind(found, "single")
    curves: list[tuple[str, list[Pair], Test]] = [
        ("noticed", effects, lambda p: p.noticed),
        ("place right first", found, lambda p: p.placed),
        ("told places hold the truth", found, _in_told),
        ("side right", [p for p in found if _sided(p)], _side_right),
        ("first state right", [p for p in found if _has_law(p)], _state_right),
        ("right name, listed", listed, lambda p: p.named),
    ]
    lines = [
        (name, *(number(share("", [p for p in some if p.strength == s], holds)) for s in STRENGTHS))
        for name, some, holds in curves
    ]
    gone = [_over("", _gone([p for p in found if p.strength == s])) for s in STRENGTHS]
    lines.append(("gap gone with the laws", *map(number, gone)))
    head = ("of single effects", *(f"near {s:.0f}×" for s in STRENGTHS))
    return Table(head, lines if effects else [], numeric=frozenset(range(1, len(head))))


def _rules(pairs: Sequence[Pair]) -> Table:
    listed = [p for p in of_kind(pairs, "single") if p.noticed and p.said.baselines]
    rules = sorted({rule for p in listed for rule in p.said.baselines})
    lines = [("the diagnosis", number(share("", listed, lambda p: p.named)))] if rules else []
    for rule in rules:
        hits = share("", listed, lambda p, r=rule: _by_rule(p, r))  # type: ignore[misc]
        lines.append((rule, number(hits)))
    return Table(("rule", "right name [95 %]"), lines, numeric=frozenset({1}))


def _by_rule(p: Pair, rule: str) -> bool:
    said = p.said.baselines.get(rule)
    return said is not None and [canonical(n) for n in said.names] == [
        e.name for e in p.truth.effects
    ]


def _wrong(pairs: Sequence[Pair]) -> Table:
    """Cases whose first place or silence is wrong, the strongest first."""

    def wrong(p: Pair) -> bool:
        if not p.truth.effects:
            return p.truth.question != DIFFERS and p.noticed
        return not (_added_among(p, 3) if p.truth.question == DIFFERS else p.noticed and p.placed)

    some = sorted((p for p in pairs if wrong(p)), key=lambda p: -p.truth.gap_worst)
    lines = [
        (p.case, p.truth.kind, " + ".join(e.name for e in p.truth.effects),
         f"{p.truth.gap_worst:.1f}", p.said.outcome,
         ", ".join(f"{q.place} {q.side} {q.name}".strip() for q in p.said.places[:3]))
        for p in some
    ]  # fmt: skip
    head = ("case", "kind", "truth", "floors", "outcome", "places told")
    return Table(head, lines, numeric=frozenset({3}))
