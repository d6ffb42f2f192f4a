"""Laws inside the simulator: parameters and coefficients fitted by replay.

The search is linear in the responses around a reference. What it found is settled here by
Gauss-Newton steps in which the laws run in the model, functions of its own simulated states.
Coordinates without a fold are one more step of the same normal equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim_device.plant.laws import joined
from smad.diagnosis.data.played import finite, predictions
from smad.diagnosis.gap import Residual
from smad.diagnosis.numerics.folds import Array, Index
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Mask, ModelPoint, Uncertainty, moved_parameters

_DAMPING = (0.0, 0.1, 1.0, 10.0)
_STEP = 0.1
_ROUNDS = 2
_LEAST_GAIN = 0.01
_RIDGE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Settled:
    """A model with laws, fitted by replay.

    Coordinates `x` (k,): parameters in prior standard deviations from the start, then coefficients
    of the responses `columns`. `left` (rows,) are the rows it leaves, `slopes` (k, rows) their
    negative derivatives, `without` (k,) a fold the coordinates without it.
    """

    columns: Index
    x: Array
    left: Array
    slopes: Array
    without: tuple[Array, ...] = ()


@dataclass(frozen=True)
class Settler:
    """Fits parameters and the laws of some responses by replay.

    `start` is where the priors of the parameters are centred, `spread` how wide they are in their
    own standard deviations.
    """

    gap: Residual
    found: Responses
    start: ModelPoint
    spread: float = 1.0

    def point(self, columns: Index, x: Array) -> ModelPoint:
        """The model at some coordinates; laws add to those of the start."""
        n = len(self.gap.plant.parameters)
        theta = moved_parameters(self.gap.plant, self.start, x[:n])
        laws = self.found.law_of(columns, x[n:])
        return ModelPoint(theta, self.start.effects, joined((*self.start.laws, *laws)))

    def first(self) -> Settled | None:
        """The parameters alone, from the gap's reference on; None where nothing can be replayed."""
        at, start = self.gap.point.theta, self.start.theta
        x = np.array([
            (at.get(q.name, q.nominal) - start.get(q.name, q.nominal)) / q.prior_sd
            for q in self.gap.plant.parameters
        ])  # fmt: skip
        none = np.zeros(0, dtype=np.intp)
        left = self._left(none, x)
        if left is None:
            return None
        now = Settled(columns=none, x=x, left=left, slopes=np.zeros((len(x), len(left))))
        for k in range(1 + _ROUNDS):
            before, now = self._cost(now), self.refreshed(now)
            if k and before - self._cost(now) < _LEAST_GAIN * before:
                break
        return now

    def extended(
        self, before: Settled, columns: Index, coefficients: Array, *, alone: bool
    ) -> Settled | None:
        """More laws beside, all coefficients begun where the linear picture has them.

        Slopes of what was there are kept: `refreshed` makes them anew. `alone`: the parameters
        stay where they were.
        """
        n = len(self.gap.plant.parameters)
        x = np.r_[before.x[:n], coefficients]
        left = self._left(columns, x)
        if left is None:
            return None
        known = len(before.x)
        slopes = self._slopes(columns, x, left, range(known, len(x)))
        slopes[:known] = before.slopes
        made = Settled(columns=columns, x=x, left=left, slopes=slopes)
        held = [w[:n] - before.x[:n] for w in before.without] if alone else None
        return self._stepped(made, held)

    def refreshed(self, settled: Settled) -> Settled:
        """One more step with slopes of where it stands."""
        slopes = self._slopes(settled.columns, settled.x, settled.left, range(len(settled.x)))
        return self._stepped(replace(settled, slopes=slopes))

    def model(self, settled: Settled) -> ModelPoint:
        """The model of all runs that count."""
        return self.point(settled.columns, settled.x)

    def uncertainty(self, settled: Settled) -> Uncertainty:
        """Covariance of parameters and coefficients in their own units, rows as they scatter."""
        A, _ = self._normal(settled)
        kept = self.gap.fold >= 0
        r = settled.left[kept]
        variance = max(float(r @ r) / max(int(kept.sum()), 1), 1e-12)
        laws, scales = self.found.coefficients(settled.columns)
        names = (*(q.name for q in self.gap.plant.parameters), *laws)
        unit = np.r_[[q.prior_sd for q in self.gap.plant.parameters], scales]
        return Uncertainty(names, unit[:, None] * np.asarray(variance * np.linalg.inv(A)) * unit)

    def held_out(self, settled: Settled) -> list[Array] | None:
        """Predictions of every run by the model that had no part of it; None if it cannot."""
        gap, out = self.gap, []
        for k, played in enumerate(gap.played):
            folds = np.unique(gap.fold[(gap.run_of_row == k) & (gap.fold >= 0)])
            x = [settled.without[f] for f in folds]
            mean = np.mean(x, axis=0) if x else settled.x
            out += predictions(self.gap.plant, self.point(settled.columns, mean), [played])
        return out if finite(out) else None

    def square(self, predicted: Sequence[Array], runs: Sequence[int]) -> float:
        """Sum of squares of the rows that predictions leave, over some runs."""
        r = self._rows(predicted)
        own = np.isin(self.gap.run_of_row, runs) & self.gap.white.valid
        return float(r[own] @ r[own])

    def _precision(self, columns: Index) -> Array:
        own = np.full(len(self.gap.plant.parameters), self.spread**-2)
        return np.concatenate([own, np.full(len(columns), _RIDGE)])

    def _normal(self, s: Settled, rows: Mask | None = None) -> tuple[Array, Array]:
        kept = self.gap.fold >= 0 if rows is None else rows
        J, p = s.slopes[:, kept], self._precision(s.columns)
        return J @ J.T + np.diag(p), J @ s.left[kept] - p * s.x

    def _stepped(self, s: Settled, held: Sequence[Array] | None = None) -> Settled:
        """One Gauss-Newton step, damped until it helps; the same where none does.

        `held` are how far the first coordinates are without each fold: these do not move.
        """
        A, g = self._normal(s)
        fixed = np.zeros(0 if held is None else len(self.gap.plant.parameters))
        for damping in _DAMPING:
            x = s.x + _step(A, g, fixed, damping)
            left = self._left(s.columns, x)
            if left is not None and self._cost(moved := replace(s, x=x, left=left)) < self._cost(s):
                s = moved
                break
        return replace(s, without=self._without(s, held))

    def _without(self, s: Settled, held: Sequence[Array] | None) -> tuple[Array, ...]:
        """Coordinates without each fold: one more step of the normal equations."""
        out = []
        for f in range(int(self.gap.fold.max(initial=-1)) + 1):
            A, g = self._normal(s, (self.gap.fold >= 0) & (self.gap.fold != f))
            out.append(s.x + _step(A, g, np.zeros(0) if held is None else held[f]))
        return tuple(out)

    def _cost(self, s: Settled) -> float:
        own = s.left[self.gap.fold >= 0]
        return float(own @ own + s.x @ (self._precision(s.columns) * s.x))

    def _left(self, columns: Index, x: Array) -> Array | None:
        found = predictions(self.gap.plant, self.point(columns, x), self.gap.played)
        return self._rows(found) if finite(found) else None

    def _rows(self, predicted: Sequence[Array]) -> Array:
        m = self.gap.measured
        left = [(y - p)[None] for y, p in zip(m.values, predicted, strict=True)]
        return np.asarray(self.gap.white(left)[0])

    def _slopes(self, columns: Index, x: Array, left: Array, which: range) -> Array:
        """−d left/dx of some coordinates, (k, rows); 0 for those that cannot be moved."""
        out = np.zeros((len(x), len(left)))
        n = len(self.gap.plant.parameters)
        for i in which:
            step = _STEP if i < n else max(_STEP, _STEP * abs(x[i]))
            for sign in (1.0, -1.0):
                q = x.copy()
                q[i] += sign * step
                moved = self._left(columns, q)
                if moved is not None and not np.array_equal(moved, left):
                    out[i] = (left - moved) / (sign * step)
                    break
        return out


def _step(A: Array, g: Array, fixed: Array, damping: float = 0.0) -> Array:
    """The solution of the normal equations whose first coordinates are `fixed`."""
    step, rest = np.zeros(len(g)), slice(len(fixed), None)
    step[: len(fixed)] = fixed
    damped = A + damping * np.diag(np.diag(A))
    step[rest] = np.linalg.solve(damped[rest, rest], (g - A @ step)[rest])
    return step
