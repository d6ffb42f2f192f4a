"""The constants under which the truth of development cases is likeliest.

Two losses are minimised in turn, each a sum over kinds of cases:

- *whether* anything is missing: −(mean log probability of what is true), over all cases but effects
  that parameters imitate. Kinds are weighed by 1 / (share of errors that goals allow): a quiet case
  called changed costs as much more as its goal is stricter. It fits the priors of nothing and of
  parameters.
- *which* it is, if anything, and where: Brier scores of rivals and of places, over the effects that
  are noticed under these. It fits the evidence, and the prior of effects.

Benches of the product's own simulator and of the independent plant count as much as each other,
however many there are of either. The level of the sets that are reported is the least at which they
hold the truth as often as they should on both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

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
from smad.diagnosis.constants import Constants
from smad.diagnosis.rivals.score import NOTHING

ALLOWED = {NONE: 1.0 / 60.0, MOVED: 1.0 / 20.0, LISTED: 0.15, UNLISTED: 0.20}
"""Share of errors that the goals allow: quiet called changed, parameters given a cause, another
name first, another place first."""
HELD = 0.96
"""How often the reported places hold the truth: between the goals of listed and of others."""
LEVELS = tuple(round(0.5 + 0.01 * k, 2) for k in range(50))
_WHAT = {NONE: "a bench without a change", MOVED: "changed parameters",
         LISTED: "an effect of the library"}  # fmt: skip
_RANGES = {"evidence": (0.2, 30.0), "nothing": (-6.0, 12.0), "parameters": (-6.0, 12.0),
           "effect": (-6.0, 12.0)}  # fmt: skip
_WHETHER, _WHICH = ("nothing", "parameters"), ("evidence", "effect")
_TURNS = 3
"""How often both are fitted: the second loss is of the effects that the first lets notice."""
_EVEN = Constants(evidence=1.0, nothing=0.0, parameters=0.0, effect=0.0, credible_level=0.95)
"""Where a fit begins: every kind equally likely."""
_PENALTY = 0.001
"""Per square of what a constant moves by from there: where cases do not say, it stays."""
_LEAST = 1e-12


def fitted(cases: Sequence[CaseRivals]) -> Constants:
    """The constants that these cases ask for. Raises BankError where they lack a kind."""
    for truth, what in _WHAT.items():
        if not any(x.truth == truth for x in cases):
            raise BankError(
                f"none of {len(cases)} cases is of {what}, which constants are fitted to: add a"
                " bank that has some, as `recover` or `play --mixture scores` make it"
            )
    c, visible = _EVEN, showing(cases)
    for _ in range(_TURNS):
        c = _least(c, _WHETHER, lambda c: whether(visible, c))
        seen = noticed(cases, c)
        c = _least(c, _WHICH, lambda c, seen=seen: which(seen, c))  # type: ignore[misc]
    return msgspec.structs.replace(c, credible_level=_credible_level(cases, c))


def noticed(cases: Sequence[CaseRivals], c: Constants) -> list[CaseRivals]:
    """The cases of which a cause is reported, and that have a right rival to be reported."""
    return [x for x in cases if x.right[x.more].any() and x.said(c).noticed]


def whether(cases: Sequence[CaseRivals], c: Constants) -> float:
    """Mean −log probability that nothing is missing where nothing is, and that something is."""
    return _loss(cases, lambda x: -_log_whether(x, x.probability(c)))


def which(cases: Sequence[CaseRivals], c: Constants) -> float:
    """Mean Brier score of the rivals and of the places, if anything is missing."""
    return _loss(cases, lambda x: _brier(x, x.probability(c)))


def _log_whether(case: CaseRivals, p: Array) -> float:
    right = {
        NONE: [r.kind == NOTHING for r in case.rivals],
        MOVED: ~case.more,
    }.get(case.truth, case.more)
    return float(np.log(p[np.asarray(right)].sum() + _LEAST))


def _brier(case: CaseRivals, p: Array) -> float:
    """Mean of two: the squares of what rivals with a part, and places, are short of the truth."""
    rivals = p[case.more] / max(float(p[case.more].sum()), _LEAST)
    right = case.right[case.more]
    places = case.places_of(p)
    wrong = [x for name, x in places.items() if name not in case.places]
    of_rivals = (1.0 - float(rivals[right].sum())) ** 2 + float((rivals[~right] ** 2).sum())
    of_places = (1.0 - sum(places.values()) + sum(wrong)) ** 2 + sum(x * x for x in wrong)
    return 0.5 * (of_rivals + of_places)


def _loss(cases: Sequence[CaseRivals], loss: Callable[[CaseRivals], float]) -> float:
    """Mean loss of each kind of case, weighed as the goals weigh its errors."""
    total = weight = 0.0
    for truth, allowed in ALLOWED.items():
        means = [
            np.mean([loss(x) for x in group])
            for exact in (True, False)
            if (group := [x for x in cases if (x.truth, x.exact) == (truth, exact)])
        ]
        if means:
            total += float(np.mean(means)) / allowed
            weight += 1.0 / allowed
    return total / max(weight, _LEAST)


def _least(start: Constants, names: Sequence[str], loss: Callable[[Constants], float]) -> Constants:
    """The constants of some names at which a loss is least."""

    def constants(w: Array) -> Constants:
        return msgspec.structs.replace(
            start, **{n: _rounded(_value(n, x)) for n, x in zip(names, w, strict=True)}
        )

    def of(w: Array) -> float:
        moved = w - even
        return loss(constants(w)) + _PENALTY * float(moved @ moved)

    even, first = (np.array([_coordinate(n, getattr(c, n)) for n in names]) for c in (_EVEN, start))
    simplex = np.concatenate([first[None], first + np.eye(len(first))])
    best = optimize.minimize(
        of,
        first,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 0.02, "fatol": 1e-4, "maxfev": 100},
    )
    return constants(best.x)


def _coordinate(name: str, value: float) -> float:
    return float(np.log(value)) if name == "evidence" else value


def _value(name: str, coordinate: float) -> float:
    value = float(np.exp(coordinate)) if name == "evidence" else float(coordinate)
    return float(np.clip(value, *_RANGES[name]))


def _credible_level(cases: Sequence[CaseRivals], c: Constants) -> float:
    """The least level at which the reported places hold the truth in `HELD` of what is noticed."""
    seen = [s for x in cases if x.truth in (LISTED, UNLISTED) for s in (x.said(c),) if s.noticed]
    kinds = [part for e in (True, False) if (part := [s for s in seen if s.case_rivals.exact == e])]
    for level in LEVELS:
        if kinds and min(_holding(part, level) for part in kinds) >= HELD:
            return level
    return LEVELS[-1]


def _holding(scored: Sequence[Said], level: float) -> float:
    """How often the places that are reported hold the truth."""
    return float(np.mean([s.reported_places_hold(level) for s in scored]))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
