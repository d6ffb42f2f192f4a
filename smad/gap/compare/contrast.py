"""Whether an effect has come since the known-good runs, or was there all along."""

from __future__ import annotations

from dataclasses import replace

from smad.gap.fit.hypothesis import Hypothesis, cluster_gain
from smad.gap.fit.judge import judge
from smad.gap.fit.lsq import FitResult, Problem, fitted
from smad.gap.plant import Effect

_ITERATIONS = 4
_ASKED_GAIN = 25.0
"""Nats from which known-good runs ask for an effect."""


def is_new(good: FitResult, candidate: Hypothesis, hold: Problem | None, errors: float) -> bool:
    """Whether the last effect of `candidate` explains the runs better than the good runs' value.

    If the good runs do not ask for the effect, it is new. If they do, it is a law that the model
    lacks, and what counts is what its value of today gains over theirs: more than `errors` standard
    errors of the held-out score.
    """
    as_before = as_in_good_runs(good, candidate.fit)
    if as_before is None:
        return True
    judged = judge([as_before], hold)[0]
    gain, error = cluster_gain(
        candidate.fit.problem, hold, candidate.judged.scores() - judged.scores()
    )
    return gain > errors * error


def as_in_good_runs(good: FitResult, fit: FitResult) -> FitResult | None:
    """`fit` with its last effect as the good runs ask for it; None where they do not."""
    effect = fit.space.effects[-1]
    known = _fitted_to(good, effect, fit)
    if good.objective - known.objective < _ASKED_GAIN:
        return None
    return _with_values(fit, effect, known)


def _fitted_to(good: FitResult, effect: Effect, fit: FitResult) -> FitResult:
    """The good runs' fit with the effect free and all else as it was."""
    values = {effect.name: fit.point.effects[effect.name]}
    space, p = good.beside((effect,), values)
    n = space.n_theta
    pinned = {i: float(p[i]) for i in range(n)}
    return fitted(
        good.problem, space, p, theta_A=good.A[:, :n], iterations=_ITERATIONS, pinned=pinned
    )


def _with_values(fit: FitResult, effect: Effect, source: FitResult) -> FitResult:
    """The refit beside the good runs' value of one effect, which is fixed there."""
    fixed = {**fit.space.fixed, effect.name: source.point.effects[effect.name]}
    space = replace(fit.space, effects=fit.space.effects[:-1], fixed=fixed)
    n = fit.space.n_theta
    return fitted(
        fit.problem,
        space,
        fit.p[: space.size],
        theta_A=fit.A[:, :n],
        iterations=_ITERATIONS,
    )
