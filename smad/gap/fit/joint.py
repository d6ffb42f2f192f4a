"""Joint fits of effects and model parameters, and how certain their values are.

Intervals come from a bootstrap over runs and blocks, from the profile of the likelihood, and from
the spread over starts, whichever is widest; never from the Jacobian alone. The bootstrap goes along
straight lines: where it ends at a bound, the profile counts, which refits. What another form of the
same law would change is added in quadrature.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.replay import Detail
from smad.gap.fit.lsq import (
    FitResult,
    FitSteps,
    Problem,
    drive,
    fitted,
    fitting,
    sensitivities,
    solve_box,
)
from smad.gap.fit.resample import DRAWS, resample_weights
from smad.gap.model.whiten import lagged_products
from smad.gap.plant import Array, Effect
from smad.gap.records import HALF_CHI2_95

_UNTOLD = 0.5
"""An interval of this share of a range or more does not tell the value."""
_PROFILE_OFFSETS = (-3.0, -1.8, -0.9, 0.9, 1.8, 3.0)
_TOGETHER = 8
FIT_ITERATIONS = 6
"""Of the later rounds."""
_SHORT_ITERATIONS, _LONGER_FITS = 1, 4
"""Iterations of the first round, and candidates that come to the second."""
_TRUSTED = 2
_CLOSELY = 0.5
"""Nats for which the last round goes on: what a set lacks here, a larger one would gain."""
_LONGEST_LAG = 100


@dataclass(frozen=True)
class Start:
    """Where a joint fit begins: the effects of the model with their values, and the parameters.

    `from_centre` begins at the middle of the prior: where an effect is strong, the refit without it
    has run away from the truth.
    """

    effects: tuple[Effect, ...]
    values: Mapping[str, Mapping[str, float]]
    from_centre: bool = False


@dataclass(frozen=True)
class JointFit:
    """The best of several starts, and where the others that fit as well ended."""

    fit: FitResult
    rivals: tuple[Array, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(e.name for e in self.fit.space.effects)


@dataclass(frozen=True)
class Interval:
    """A fitted parameter of an effect with its fit interval.

    `profile` holds (value, rise of the negative log-likelihood). `identifiable` is False where the
    profile never rises to the 95 % level inside the range on either side.
    """

    effect: str
    name: str
    unit: str
    value: float
    low: float
    high: float
    at_bound: bool
    identifiable: bool
    profile: tuple[tuple[float, float], ...]


def joint_fits(
    base: FitResult, starts: Sequence[Start], *, finish: int = 2
) -> dict[tuple[str, ...], JointFit]:
    """Fits every start, in step, and keeps the best of each of the better sets of effects.

    In three rounds, each for fewer: a short and rough one for every start; a longer one for the
    best start of the better sets, rough too but for the first two sets given, since what is quick
    is hidden from rough replays; and, for the best `finish` sets, one in detail and to the end.
    """
    problem = base.problem.matching(base.point, base.predicted)
    ends: dict[tuple[str, ...], JointFit] = {}

    def best_first(sets: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
        return sorted(sets, key=lambda names: (ends[names].fit.objective, names))

    short = [_short(problem, base, start) for start in starts]
    for i in range(0, len(short), _TOGETHER):
        _enter(ends, short[i : i + _TOGETHER])
    given = list(dict.fromkeys(tuple(e.name for e in start.effects) for start in starts))
    trusted = given[:_TRUSTED]
    kept = list(dict.fromkeys([*trusted, *best_first(ends)]))[:_LONGER_FITS]
    known = _known(base)
    longer = best_first(kept)
    _enter(
        ends,
        [_long(problem, ends[n].fit, theta_A=known, rough=n not in trusted) for n in longer],
    )
    # Sensitivities of the parameters are renewed, unless known-good runs hold these in their place.
    tied = base.space.tie is not None
    last = best_first(kept)[:finish]
    _enter(
        ends,
        [
            _long(
                problem,
                ends[n].fit,
                theta_A=known if tied else None,
                refresh_theta=not tied,
                tolerance=_CLOSELY,
            )
            for n in last
        ],
    )
    return {names: ends[names] for names in kept}


def _known(base: FitResult) -> NDArray[np.float32]:
    """The sensitivities of the parameters in the model without more effects."""
    return base.A[:, : base.space.n_theta]


def _short(problem: Problem, base: FitResult, start: Start) -> FitSteps:
    space, p = base.beside(start.effects, start.values)
    if start.from_centre:
        p[: space.n_theta] = 0.0
    return fitting(
        problem, space, p, theta_A=_known(base), iterations=_SHORT_ITERATIONS, rough=True
    )


def _long(problem: Problem, fit: FitResult, **how: Any) -> FitSteps:
    return fitting(problem, fit.space, fit.p, iterations=FIT_ITERATIONS, **how)


def _enter(ends: dict[tuple[str, ...], JointFit], fits: Sequence[FitSteps]) -> None:
    """Runs fits in step; of a set keeps the better fit whole, of the other only where it ended."""
    for fit in drive(fits):
        names = tuple(e.name for e in fit.space.effects)
        known = ends.get(names, JointFit(fit, ()))
        best, other = sorted((known.fit, fit), key=lambda f: f.objective)
        rivals = known.rivals if best is known.fit or _near(best, other) else ()
        if other is not best and _near(best, other):
            rivals = (*rivals, other.p)
        ends[names] = JointFit(best, rivals)


def _near(best: FitResult, other: FitResult) -> bool:
    return other.objective - best.objective < HALF_CHI2_95


def polished(fit: FitResult) -> FitResult:
    """The fit with all sensitivities renewed, and a few more steps."""
    return fitted(
        fit.problem,
        fit.space,
        fit.p,
        iterations=3,
        refresh_theta=True,
    )


def bootstrap(fit: FitResult, draws: int, seed: int, *, prior: bool = False) -> Array:
    """One-step estimates on resampled runs and blocks; shape (draws, coordinates).

    That is how far the runs scatter an estimate. What they do not tell stays where the prior has
    it, in every draw. With `prior` its mean is drawn from it each time (randomised maximum
    likelihood, Oliver 1996): the draws then are a posterior, as wide as the prior there.
    """
    H, g = fit.normal_equations()
    ev = fit.problem.dataset
    rng = np.random.default_rng(seed)
    weights = resample_weights(ev.cell_run, ev.cell_block, draws, rng)
    lo, hi = fit.space.bounds()
    _, precision = fit.space.prior()
    k = fit.space.size
    Hs = (weights @ H.reshape(len(H), -1)).reshape(draws, k, k) + precision
    gs = (weights - 1.0) @ g
    if prior:
        gs += rng.standard_normal((draws, k)) @ np.linalg.cholesky(precision).T
    return np.array(
        [fit.p + solve_box(a, b, lo - fit.p, hi - fit.p) for a, b in zip(Hs, gs, strict=True)]
    )


def posterior(fit: FitResult, draws: int, seed: int) -> Array:
    """Draws of what the runs and the prior leave open around a fit; shape (draws, coordinates).

    Sensitivities are renewed in full detail. Those of coarse replays give directions that the runs
    hardly tell a slope of their own, and the values along them too little room.
    """
    wanted = sensitivities(fit.problem, fit.space, fit.p, range(fit.space.size), detail=Detail.FINE)
    (slopes,) = drive([wanted])
    return bootstrap(replace(fit, A=slopes), draws, seed, prior=True)


def dispersion(problem: Problem, z: Array) -> dict[str, float]:
    """Effective share of independent rows of each output, 1 for white residuals.

    1/(1 + 2 Σ ρ) over lags up to the first that is not positive.
    """
    ev = problem.dataset
    longest = _LONGEST_LAG
    out = {}
    for key in ev.keys:
        acf = lagged_products([z[seg.rows] for seg in ev.rows_of(key)], longest)
        rho = acf / acf[0] if acf[0] > 0 else acf
        stop = np.flatnonzero(rho[1:] <= 0.02)
        last = int(stop[0]) + 1 if len(stop) else longest
        out[key] = float(1.0 / (1.0 + 2.0 * np.sum(rho[1:last])))
    return out


def independent_share(fit: FitResult) -> float:
    """Effective share of independent rows of a fit: the mean of `dispersion` over its outputs."""
    return float(np.mean(list(dispersion(fit.problem, fit.z).values())))


def intervals(joint: JointFit, seed: int, form_share: float = 0.0) -> list[Interval]:
    """Fit intervals of the parameters of every effect in a joint fit, from scatter alone.

    `form_share` is the share of a strength that another form of the same law may differ by.
    """
    fit = joint.fit
    draws = bootstrap(fit, DRAWS, seed)
    columns = list(range(fit.space.n_theta, fit.space.size))
    profiles = _profiles(fit, columns, draws)
    temper = independent_share(fit)
    lo, hi = fit.space.bounds()
    before, _ = fit.space.prior()
    flat = [(e, q) for e in fit.space.effects for q in e.parameters]
    out = []
    for i in columns:
        effect, q = flat[i - fit.space.n_theta]
        low, high = (float(v) for v in np.quantile(draws[:, i], (0.025, 0.975)))
        curve = [(v, temper * rise) for v, rise in profiles[i]]
        below, above = _crossing(curve, fit.p[i], -1), _crossing(curve, fit.p[i], +1)
        if below is not None:
            low = below if low <= lo[i] else min(low, below)
        if above is not None:
            high = above if high >= hi[i] else max(high, above)
        for rival in joint.rivals:
            low, high = min(low, float(rival[i])), max(high, float(rival[i]))
        if below is None and above is None:
            # All that was tried is within the level: the interval is at least that wide.
            low, high = min(low, curve[0][0]), max(high, curve[-1][0])
        value = fit.space.value
        margin = form_share * abs(float(fit.p[i] - before[i])) if q.strength else 0.0
        here = float(fit.p[i])
        low, high = here - hypot(here - low, margin), here + hypot(high - here, margin)
        out.append(
            Interval(
                effect.name,
                q.name,
                q.unit,
                value(i, here),
                value(i, max(low, float(lo[i]))),
                value(i, min(high, float(hi[i]))),
                fit.at_bound[i],
                high - low < _UNTOLD * float(hi[i] - lo[i]),
                tuple((value(i, v), rise) for v, rise in curve),
            )
        )
    return out


def _profiles(
    fit: FitResult, columns: Sequence[int], draws: Array
) -> dict[int, list[tuple[float, float]]]:
    """(coordinate, rise of the objective), all else refitted, at a few values of each column."""
    lo, hi = fit.space.bounds()
    jobs: list[tuple[int, float]] = []
    for i in columns:
        spread = max(float(np.std(draws[:, i])), 2e-3)
        values = {float(np.clip(fit.p[i] + o * spread, lo[i], hi[i])) for o in _PROFILE_OFFSETS}
        jobs += [(i, v) for v in sorted(values) if abs(v - fit.p[i]) > 1e-6]
    problem = fit.problem.matching(fit.point, fit.predicted)
    steps = []
    for i, v in jobs:
        p = fit.p.copy()
        p[i] = v
        A = fit.A[:, : fit.space.n_theta]
        steps.append(
            fitting(problem, fit.space, p, theta_A=A, iterations=2, pinned={i: v}, rough=True)
        )
    ends = drive(steps)
    out: dict[int, list[tuple[float, float]]] = {i: [(float(fit.p[i]), 0.0)] for i in columns}
    for (i, v), end in zip(jobs, ends, strict=True):
        out[i].append((v, max(0.0, end.objective - fit.objective)))
    return {i: sorted(curve) for i, curve in out.items()}


def _crossing(curve: Sequence[tuple[float, float]], centre: float, side: int) -> float | None:
    """Where a profile reaches the 95 % level on one side, by linear interpolation of its root."""
    ordered = sorted((c for c in curve if side * (c[0] - centre) >= 0), key=lambda c: side * c[0])
    for (x0, y0), (x1, y1) in pairwise(ordered):
        if y1 >= HALF_CHI2_95 > y0:
            r0, r1 = np.sqrt(y0), np.sqrt(y1)
            return float(x0 + (x1 - x0) * (np.sqrt(HALF_CHI2_95) - r0) / (r1 - r0))
    return None
