"""A flexible, regime-local correction: how much of a residual depends on state at all.

It names nothing. Fitted to the residual of some runs and judged on others, it is the ceiling that a
named cause is compared with, and, fitted to known-good runs, the template of their background.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from smad.gap.data.replay import Dataset
from smad.gap.plant import Array

_KNOTS = (0.05, 0.25, 0.5, 0.75, 0.95)
_MEMORY = (15, 60)
"""Rows over which a feature is remembered: a fifth of its correlation time, and nearly all."""
_RIDGES = (3.0, 30.0, 300.0, 3000.0)
_STRETCHES = 5


@dataclass(frozen=True)
class Basis:
    """Piecewise-linear functions of features and of their fading memory, and regime indicators.

    Knots come from the runs it was made on; beyond the outer knots every function is constant, so
    that a correction cannot grow where it was never seen.
    """

    knots: dict[str, Array]
    regimes: tuple[str, ...]

    @classmethod
    def of(cls, dataset: Dataset, side: str) -> Basis:
        """A basis for one side, with knots at quantiles over the runs of `dataset`."""
        pooled: dict[str, list[Array]] = {}
        for r in range(len(dataset.runs)):
            for name, column in _columns(dataset, r, side).items():
                pooled.setdefault(name, []).append(column)
        knots = {}
        for name, parts in pooled.items():
            if len(parts) < len(dataset.runs):
                continue
            q = np.unique(np.round(np.quantile(np.concatenate(parts), _KNOTS), 12))
            if len(q) >= 2 and q[-1] > q[0]:
                knots[name] = q
        names = tuple(dataset.plant.regimes(dataset.runs[0], side))
        return cls(knots, names)

    def design(self, dataset: Dataset, run: int, side: str) -> Array:
        """Design matrix of one run; shape (bins, functions)."""
        columns = _columns(dataset, run, side)
        grid = dataset.grids[run]
        parts = [np.ones(len(grid.t_s))]
        for name, q in self.knots.items():
            v = columns.get(name)
            if v is None:
                v = np.full(len(grid.t_s), q[0])
            span = q[-1] - q[0]
            for a, b in pairwise(q):
                parts.append((np.clip(v, a, b) - a) / span * np.sqrt(len(q)))
        masks = dataset.plant.regimes(dataset.runs[run], side)
        # A run that lacks a channel may lack the regimes that are read from it.
        never = np.zeros(len(grid.t_s))
        parts += [
            grid.majority(masks[n]).astype(float) if n in masks else never for n in self.regimes
        ]
        return np.column_stack(parts)


def _columns(dataset: Dataset, run: int, side: str) -> dict[str, Array]:
    grid = dataset.grids[run]
    out = {}
    for name, column in dataset.plant.features(dataset.runs[run], side).items():
        binned = grid.mean(np.nan_to_num(column))
        out[name] = binned
        for memory in _MEMORY:
            keep = float(np.exp(-1.0 / memory))
            out[f"{name}~{memory}"] = lfilter(
                [1 - keep], [1.0, -keep], binned, zi=np.array([keep * binned[0]])
            )[0]
    return out


@dataclass(frozen=True)
class Correction:
    """A correction of one output. `explained` is the share of the residual power it explains in
    folds left out, before the ridge of the best of several is refitted to all."""

    basis: Basis
    side: str
    weights: Array
    explained: float

    def __call__(self, dataset: Dataset, run: int) -> Array:
        return self.basis.design(dataset, run, self.side) @ self.weights


@dataclass(frozen=True)
class _Normal:
    gram: Array
    moment: Array
    power: float


def _normal(design: Array, y: Array, weight: Array) -> _Normal:
    d = design * weight[:, None]
    return _Normal(d.T @ design, d.T @ y, float(weight @ (y * y)))


def _solve(normals: Sequence[_Normal], ridge: float) -> Array:
    gram = np.sum([n.gram for n in normals], axis=0)
    moment = np.sum([n.moment for n in normals], axis=0)
    penalty = np.full(len(moment), ridge)
    penalty[0] = 1e-6
    return np.linalg.solve(gram + np.diag(penalty), moment)


@dataclass(frozen=True)
class Designs:
    """Bases and design matrices of some runs, made once for each side."""

    dataset: Dataset
    bases: dict[str, Basis]
    matrices: dict[tuple[int, str], Array]

    @classmethod
    def of(cls, dataset: Dataset) -> Designs:
        sides = list(dict.fromkeys(s.side for s in dataset.segments))
        bases = {side: Basis.of(dataset, side) for side in sides}
        wanted = dict.fromkeys((s.run, s.side) for s in dataset.segments)
        return cls(
            dataset, bases, {at: bases[at[1]].design(dataset, at[0], at[1]) for at in wanted}
        )

    def on(self, other: Dataset) -> dict[tuple[int, str], Array]:
        """The same bases evaluated on other runs."""
        wanted = dict.fromkeys((s.run, s.side) for s in other.segments)
        return {at: self.bases[at[1]].design(other, at[0], at[1]) for at in wanted}


def fit_correction(
    made: Designs, residual: Array, scale: Array, key: str
) -> tuple[Correction, Array]:
    """Correction of one output, and its prediction of each fold without that fold (rows).

    `residual` and `scale` are rows of the runs that `made` is of. A fold is a run; where there is
    one run only, one of five stretches of it.
    """
    dataset = made.dataset
    segments = dataset.rows_of(key)
    side = segments[0].side
    folds = [
        (slice(s.start + a, s.start + b), made.matrices[s.run, side][a:b])
        for s in segments
        for a, b in _stretches(s.stop - s.start, alone=len(segments) == 1)
    ]
    normals = [
        _normal(design, residual[rows], dataset.valid[rows] / np.square(scale[rows]))
        for rows, design in folds
    ]
    power = sum(n.power for n in normals)
    best_ridge, best_loss = _RIDGES[-1], np.inf
    for ridge in _RIDGES:
        loss = 0.0
        for i, own in enumerate(normals):
            w = _solve([n for j, n in enumerate(normals) if j != i], ridge)
            loss += own.power - 2 * float(w @ own.moment) + float(w @ own.gram @ w)
        if loss < best_loss:
            best_ridge, best_loss = ridge, loss
    out = np.zeros(dataset.n)
    for i, (rows, design) in enumerate(folds):
        w = _solve([n for j, n in enumerate(normals) if j != i], best_ridge)
        out[rows] = design @ w
    explained = 1.0 - best_loss / power if power > 0 else 0.0
    return Correction(made.bases[side], side, _solve(normals, best_ridge), explained), out


def _stretches(length: int, *, alone: bool) -> list[tuple[int, int]]:
    edges = np.linspace(0, length, _STRETCHES + 1 if alone else 2).astype(int).tolist()
    return list(pairwise(edges))
