"""The five constants under which the truth of development cases is likeliest.

What is minimised is the sum over kinds of cases of

    −(mean of log p(right)/(p(right) + p(likeliest wrong))) / (share of errors that goals allow),

since the likeliest rival is the answer: a quiet case called changed costs as much more as its goal
is stricter. Benches of the product's own simulator and of the independent plant count as much as
each other, however many there are of either. The level of the sets that are told is the least at
which they hold the truth as often as they should on both.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from scipy import optimize

from evaluation.calibrate.rivals import LISTED, MOVED, NONE, UNLISTED, Asked, Said
from evaluation.errors import BankError
from smad.diagnosis.constants import Constants

ALLOWED = {NONE: 1.0 / 60.0, MOVED: 1.0 / 20.0, LISTED: 0.15, UNLISTED: 0.20}
"""Share of errors that the goals allow: quiet called changed, parameters given a cause, another
name first, another place first."""
HELD = 0.96
"""How often the places that are told hold the truth: between the goals of listed and of others."""
LEVELS = tuple(round(0.5 + 0.01 * k, 2) for k in range(50))
_WHAT = {NONE: "a bench without a change", MOVED: "changed parameters",
         LISTED: "an effect of the library"}  # fmt: skip
_RANGES = {"evidence": (0.2, 30.0), "nothing": (-6.0, 12.0), "parameters": (-6.0, 12.0),
           "effect": (-6.0, 12.0)}  # fmt: skip
_PENALTY = 0.02
"""Per square of what a log prior moves by: where cases do not say, it stays."""
_LEAST = 1e-12


def fitted(cases: Sequence[Asked], before: Constants) -> Constants:
    """The constants that these cases ask for. Raises BankError where they lack a kind.

    Effects that parameters imitate to within the floor count for none of them.
    """
    for truth, what in _WHAT.items():
        if not any(x.truth == truth for x in cases):
            raise BankError(
                f"none of {len(cases)} cases is of {what}, which constants are fitted to: add a"
                " bank that has some, as `recover` or `play --mixture scores` make it"
            )
    usable = [x for x in cases if x.right.any() and not x.hidden]
    c = _likeliest(usable, before)
    return msgspec.structs.replace(c, told_level=_told_level(usable, c))


def cost(cases: Sequence[Asked], c: Constants) -> float:
    """What is minimised; cases without a right rival must not be among them."""
    total = 0.0
    for truth, allowed in ALLOWED.items():
        means = [
            np.mean([_log_lead(x, c) for x in some])
            for exact in (True, False)
            if (some := [x for x in cases if (x.truth, x.exact) == (truth, exact)])
        ]
        if means:
            total -= float(np.mean(means)) / allowed
    return total / sum(1.0 / a for a in ALLOWED.values())


def _log_lead(case: Asked, c: Constants) -> float:
    """Log of the probability of the right rivals, the likeliest wrong one alone beside them."""
    p = case.probability(c)
    right = p[case.right].sum() + _LEAST
    return float(np.log(right / (right + p[~case.right].max(initial=0.0))))


def _likeliest(cases: Sequence[Asked], before: Constants) -> Constants:
    names = list(_RANGES)
    low, high = np.array(list(_RANGES.values())).T
    low[0], high[0] = np.log(low[0]), np.log(high[0])

    def constants(w: np.ndarray) -> Constants:
        w = np.clip(w, low, high)
        values = dict(zip(names, map(float, w), strict=True)) | {"evidence": float(np.exp(w[0]))}
        return msgspec.structs.replace(before, **{n: _rounded(x) for n, x in values.items()})

    def of(w: np.ndarray) -> float:
        outside = float(np.abs(w - np.clip(w, low, high)).sum())
        moved = w[1:] - start[1:]
        return cost(cases, constants(w)) + _PENALTY * float(moved @ moved) + outside

    start = np.array([np.log(before.evidence), *(getattr(before, n) for n in names[1:])])
    found = optimize.minimize(of, start, method="Nelder-Mead",
                              options={"xatol": 0.02, "fatol": 1e-4, "maxfev": 400})  # fmt: skip
    return constants(found.x)


def _told_level(cases: Sequence[Asked], c: Constants) -> float:
    """The least level at which the told places hold the truth in `HELD` of what is noticed."""
    said = [s for x in cases if x.truth in (LISTED, UNLISTED) for s in (x.said(c),) if s.noticed]
    kinds = [some for e in (True, False) if (some := [s for s in said if s.asked.exact == e])]
    for level in LEVELS:
        if kinds and min(_holding(some, level) for some in kinds) >= HELD:
            return level
    return LEVELS[-1]


def _holding(said: Sequence[Said], level: float) -> float:
    """How often the places that are told hold the truth."""
    return float(np.mean([s.told_places_hold(level) for s in said]))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
