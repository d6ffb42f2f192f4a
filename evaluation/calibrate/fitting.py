"""The constants under which the truth of development cases is likeliest.

The sum of two losses is minimised:

- *whether* anything is missing: −(mean log probability of what is true), over all cases but effects
  that parameters imitate. Kinds are weighed by 1 / (share of errors that goals allow): a quiet case
  called changed costs as much more as its goal is stricter.
- *which* it is, if anything, and where: Brier scores of rivals and of places, over the effects that
  are noticed. Every case weighs alike: of the effects that banks add three of four are listed.

Benches of the product's own simulator and of the independent plant count as much as each other,
however many there are of either. The level of the sets that are reported is the least at which they
hold the truth as often as the goals ask, of listed effects and of others, on both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import msgspec
import numpy as np
from scipy import optimize

from evaluation.calibrate.rivals import (
    LISTED,
    MOVED,
    NONE,
    UNLISTED,
    Array,
    CaseRivals,
    Said,
    showing,
)
from evaluation.errors import BankError
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.rivals.score import NOTHING

ALLOWED = {NONE: 1.0 / 60.0, MOVED: 1.0 / 20.0, LISTED: 0.15, UNLISTED: 0.20}
"""Share of errors that the goals allow: quiet called changed, parameters given a cause, another
name first, another place first."""
HELD = {LISTED: 0.97, UNLISTED: 0.93}
"""How often the goals want the reported places to hold the truth."""
LEVELS = tuple(round(0.5 + 0.01 * k, 2) for k in range(50))
_WHAT = {NONE: "a bench without a change", MOVED: "changed parameters",
         LISTED: "an effect of the library"}  # fmt: skip
_RANGES = {"evidence": (0.2, 30.0), "nothing": (-6.0, 12.0), "parameters": (-6.0, 12.0),
           "effect": (-6.0, 12.0)}  # fmt: skip
_TURNS = 3
"""How often they are fitted: what is noticed depends on them."""
_PENALTY = 0.001
"""Per square of what a constant moves by from the shipped one: where cases do not say, it stays."""
_LEAST = 1e-12
Judged = tuple[CaseRivals, Constants]
"""A case, and the constants that its rivals are compared by."""


def fitted(cases: Sequence[CaseRivals]) -> Constants:
    """The constants that these cases ask for. Raises BankError where they lack a kind."""
    for truth, what in _WHAT.items():
        if not any(x.truth == truth for x in cases):
            raise BankError(
                f"none of {len(cases)} cases is of {what}, which constants are fitted to: add a"
                " bank that has some, as `recover` or `play --mixture scores` make it"
            )
    c, visible = shipped(), showing(cases)
    for _ in range(_TURNS):
        c = _least(c, partial(_loss, visible, noticed(cases, c)))
    return msgspec.structs.replace(c, credible_level=_credible_level(cases, c))


def _loss(visible: Sequence[CaseRivals], seen: Sequence[CaseRivals], c: Constants) -> float:
    return whether([(x, c) for x in visible]) + which([(x, c) for x in seen])


def noticed(cases: Sequence[CaseRivals], c: Constants) -> list[CaseRivals]:
    """The cases of which a cause is reported, and that have a right rival to be reported."""
    return [x for x in cases if x.right[x.more].any() and x.said(c).noticed]


def whether(cases: Sequence[Judged]) -> float:
    """Mean −log probability that nothing is missing where nothing is, and that something is, of
    cases by constants."""
    total = weight = 0.0
    for truth, allowed in ALLOWED.items():
        if kind := [x for x in cases if x[0].truth == truth]:
            total += _of_plants(kind, _log_loss) / allowed
            weight += 1.0 / allowed
    return total / max(weight, _LEAST)


def which(cases: Sequence[Judged]) -> float:
    """Mean Brier score of the rivals and of the places, if anything is missing, of cases by
    constants."""
    return _of_plants(cases, _brier) if cases else 0.0


def _log_loss(case: CaseRivals, c: Constants) -> float:
    right = {
        NONE: [r.kind == NOTHING for r in case.rivals],
        MOVED: ~case.more,
    }.get(case.truth, case.more)
    return -float(np.log(case.probability(c)[np.asarray(right)].sum() + _LEAST))


def _brier(case: CaseRivals, c: Constants) -> float:
    """Mean of two: the squares of what rivals with a part, and places, are short of the truth."""
    p = case.probability(c)
    rivals = p[case.more] / max(float(p[case.more].sum()), _LEAST)
    right = case.right[case.more]
    places = case.places_of(p)
    wrong = [x for name, x in places.items() if name not in case.places]
    of_rivals = (1.0 - float(rivals[right].sum())) ** 2 + float((rivals[~right] ** 2).sum())
    of_places = (1.0 - sum(places.values()) + sum(wrong)) ** 2 + sum(x * x for x in wrong)
    return 0.5 * (of_rivals + of_places)


def _of_plants(cases: Sequence[Judged], loss: Callable[[CaseRivals, Constants], float]) -> float:
    """Mean loss on each plant, averaged."""
    groups = ([x for x in cases if x[0].exact == exact] for exact in (True, False))
    return float(np.mean([np.mean([loss(*x) for x in group]) for group in groups if group]))


def _least(start: Constants, loss: Callable[[Constants], float]) -> Constants:
    """The constants at which a loss is least."""
    names = tuple(_RANGES)

    def constants(w: Array) -> Constants:
        return msgspec.structs.replace(
            start, **{n: _rounded(_value(n, x)) for n, x in zip(names, w, strict=True)}
        )

    def of(w: Array) -> float:
        moved = w - before
        return loss(constants(w)) + _PENALTY * float(moved @ moved)

    before, first = (
        np.array([_coordinate(n, getattr(c, n)) for n in names]) for c in (shipped(), start)
    )
    simplex = np.concatenate([first[None], first + np.eye(len(first))])
    best = optimize.minimize(
        of,
        first,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 0.02, "fatol": 1e-4, "maxfev": 200},
    )
    return constants(best.x)


def _coordinate(name: str, value: float) -> float:
    return float(np.log(value)) if name == "evidence" else value


def _value(name: str, coordinate: float) -> float:
    value = float(np.exp(coordinate)) if name == "evidence" else float(coordinate)
    return float(np.clip(value, *_RANGES[name]))


def _credible_level(cases: Sequence[CaseRivals], c: Constants) -> float:
    """The least level at which the reported places hold the truth as often as `HELD` says, of what
    is noticed."""
    seen = [s for x in cases for s in (x.said(c),) if s.noticed]
    groups = [
        (group, least)
        for truth, least in HELD.items()
        for exact in (True, False)
        if (
            group := [
                s for s in seen if s.case_rivals.truth == truth and s.case_rivals.exact == exact
            ]
        )
    ]
    for level in LEVELS:
        if groups and all(_holding(group, level) >= least for group, least in groups):
            return level
    return LEVELS[-1]


def _holding(scored: Sequence[Said], level: float) -> float:
    """How often the places that are reported hold the truth."""
    return float(np.mean([s.reported_places_hold(level) for s in scored]))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
