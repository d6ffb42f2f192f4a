"""Judging a fit on runs it was not fitted to, and the measures of a gap.

Held-out predictions come from runs named for it, or else from leaving each run out in turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.replay import Detail
from smad.gap.fit.leave_out import left_out
from smad.gap.fit.lsq import FitResult, Problem, solve_box
from smad.gap.plant import Array, Mask, ModelPoint

_LEAST_REGIME = 0.05
"""Share of the rows below which a regime is not left out in turn."""
_DETERMINED_SHARE = 0.2
"""Information on a cause that must be left without a regime for that to be left out."""


@dataclass(frozen=True)
class Judged:
    """Held-out residuals of one model.

    `left_out` are predictions of the fit runs, each without itself, and `points` the model points
    that make them, empty where nothing was left out; `held` are predictions of the hold-out runs,
    empty without any. `predicted` of each is kept to show it.
    """

    problem: Problem
    hold: Problem | None
    left_out: Array
    held: Array
    points: tuple[ModelPoint, ...] = ()

    def scores(self) -> Array:
        """Log-likelihood of every held-out cell: the fit runs' cells, then the hold-out runs'."""
        own = self.problem.cell_score(self.problem.white(self.left_out))
        if self.hold is None:
            return own
        held = self.hold.cell_score(self.hold.white(self.held))
        return np.asarray(np.r_[own, held], dtype=np.float64)

    @property
    def bench(self) -> Problem:
        """The problem whose runs the shrink is judged on."""
        return self.problem if self.hold is None else self.hold

    @property
    def predicted(self) -> Array:
        """Held-out prediction on `bench`."""
        return self.left_out if self.hold is None else self.held

    def squares(self) -> Array:
        """Squared residual over floor variance, by row of `bench`; 1 is the floor."""
        return np.asarray(np.square(self.bench.scaled(self.predicted)))

    def excess(self, keys: Sequence[str] | None = None, weight: Array | None = None) -> float:
        """G over the floor: sqrt of the mean over outputs of max(0, MSE/floor² − 1)."""
        return excess_of(self.bench, self.squares(), keys, weight)


def excess_by_key(
    problem: Problem, squares: Array, weight: Array | None = None
) -> dict[str, float]:
    """max(0, MSE/floor² − 1) of each output; `weight` counts rows (bootstrap), 1 by default."""
    ev = problem.dataset
    w = ev.valid.astype(float) if weight is None else weight * ev.valid
    out = {}
    for key in ev.keys:
        total = count = 0.0
        for seg in ev.rows_of(key):
            total += float(w[seg.rows] @ squares[seg.rows])
            count += float(w[seg.rows].sum())
        if count > 0:
            out[key] = max(0.0, total / count - 1.0)
    return out


def excess_of(
    problem: Problem, squares: Array, keys: Sequence[str] | None, weight: Array | None = None
) -> float:
    """G over the floor of `keys` together (all, by default)."""
    by_key = excess_by_key(problem, squares, weight)
    chosen = [v for k, v in by_key.items() if keys is None or k in keys]
    return float(np.sqrt(np.mean(chosen))) if chosen else 0.0


def shrink(after: float, before: float) -> float:
    """S = 1 − G_after/G_before; 0 where there was no gap."""
    return 1.0 - after / before if before > 0 else 0.0


def judge(fits: Sequence[FitResult], hold: Problem | None) -> list[Judged]:
    """Held-out predictions of each fit, in full detail.

    A coarse step costs one model more than another: what it costs each is learnt at its own point.
    """
    out = []
    held_points = [fit.point for fit in fits]
    held = np.zeros((len(fits), 0))
    if hold is not None:
        held = hold.dataset.predict(held_points, detail=Detail.FINE)
    for i, fit in enumerate(fits):
        left = left_out(fit)
        predicted = left.predicted + fit.problem.dataset.coarse_error(fit.point, fit.predicted)
        out.append(Judged(fit.problem, hold, predicted, held[i], left.points))
    return out


def predict_by_run(
    problem: Problem, points: Sequence[ModelPoint], fallback: ModelPoint | None = None
) -> Array:
    """Predictions with a point of its own for each run.

    A point that the plant cannot simulate is drawn half way to `fallback`, up to three times, and
    then replaced by it.
    """
    ev = problem.dataset
    out = np.zeros(ev.n)
    for run, wanted in enumerate(points):
        point = wanted
        for attempt in range(5):
            values = ev.predict([point], runs=[run])[0]
            if fallback is None or attempt == 4 or not ev.failed(values, run):
                break
            point = fallback if attempt == 3 else between(point, fallback)
        out += values
    return out


def between(a: ModelPoint, b: ModelPoint) -> ModelPoint:
    """The point half way from `a` to `b`, which have the same coordinates."""
    theta = {k: 0.5 * (v + b.theta[k]) for k, v in a.theta.items()}
    effects = {
        name: {k: 0.5 * (v + b.effects[name][k]) for k, v in values.items()}
        for name, values in a.effects.items()
    }
    return ModelPoint(theta, effects)


def regime_gains(
    before: FitResult, after: FitResult, masks: Mapping[str, Mask]
) -> dict[str, float]:
    """Gain in log-likelihood on each regime, predicted from the other regimes alone.

    Linear around each fit: the step that leaving the regime's rows out would make is undone, and
    the rows are scored with what remains. Left out of the question are regimes of few rows,
    and those without which the effects' parameters of either model are no
    longer determined.
    """
    out = {}
    one, other = _Weighted.of(after), _Weighted.of(before)
    for name, mask in masks.items():
        if not _LEAST_REGIME <= float(mask.mean()) <= 0.8:
            continue
        own, others = one.scored_without(mask), other.scored_without(mask)
        if own is not None and others is not None:
            out[name] = own - others
    return out


@dataclass(frozen=True)
class _Weighted:
    """A fit, its sensitivities and residual as they weigh in it, and their products (k, k)."""

    fit: FitResult
    A: NDArray[np.float32]
    z: NDArray[np.float32]
    H: Array

    @classmethod
    def of(cls, fit: FitResult) -> _Weighted:
        w = np.sqrt(fit.problem.row_weight(fit.z)).astype(np.float32)
        A = fit.A * w[:, None]
        return cls(fit, A, w * fit.z.astype(np.float32), (A.T @ A).astype(float))

    def scored_without(self, mask: Mask) -> float | None:
        """Log-likelihood of some rows by the others; None where those do not tell the effects."""
        fit = self.fit
        _, precision = fit.space.prior()
        lo, hi = fit.space.bounds()
        A = self.A[mask]
        H = self.H - (A.T @ A).astype(float) + precision
        n = fit.space.n_theta
        if np.any(_information(H, n) < _DETERMINED_SHARE * _information(self.H + precision, n)):
            return None
        g = -(self.z[mask] @ A).astype(float)
        step = solve_box(H, g, lo - fit.p, hi - fit.p)
        z = np.zeros(len(mask))
        z[mask] = fit.z[mask] - fit.A[mask] @ step.astype(np.float32)
        ev, nu = fit.problem.dataset, fit.problem.dataset.settings.cell_dof
        count = ev.cell_sum((mask & ev.valid).astype(float))
        return float(np.sum(-0.5 * (nu + count) * np.log1p(ev.cell_sum(z * z) / nu) * (count > 0)))


def _information(H: Array, n_theta: int) -> Array:
    """Information on each effect parameter, all others free; shape (effect parameters,)."""
    return np.asarray(1.0 / np.diag(np.linalg.inv(H))[n_theta:])
