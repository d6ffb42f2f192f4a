"""Linear-Gaussian inference from inner products: r = Aᵀx + e, e ~ N(0, I), x ~ N(0, (λD)⁻¹).

D is the diagonal of prior precisions of the responses (1 is a main effect, more is shrunk more),
λ the ridge. The ridge is chosen by leaving folds out, and what a choice takes of held-out rows is
measured on folds that had no part in the choice (nested cross-validation, Stone 1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.folds import Array, FoldProducts

RIDGES: Array = np.geomspace(1e-6, 1e3, 10)
"""Ridges that are tried, in mean squared lengths of the responses."""
_LEAST = 1e-12


@dataclass(frozen=True)
class HeldOut:
    """What responses take of rows that they were not fitted to.

    `taken` (f,) is what each fold's sum of squares loses to coefficients of the other folds
    (negative where it grows), `share` their sum over the sum of squares of all folds, `ridge` the
    one that all folds together choose.
    """

    share: float
    taken: Array
    ridge: float


@dataclass(frozen=True)
class Posterior:
    """Coefficients (k,) and their covariance (k, k) where a row has variance 1."""

    mean: Array
    covariance: Array


def held_out(products: FoldProducts, precision: Array) -> HeldOut:
    """Return what the responses take of held-out folds; `precision` (k,) is the diagonal of D.

    Raises ValueError for fewer than three folds: one is held out, one chooses the ridge.
    """
    if products.folds < 3:
        raise ValueError(f"{products.folds} folds; nested leaving-out needs 3 or more")
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    scale = _scale(gram, precision)
    inner = np.zeros((products.folds, len(RIDGES)))
    taken = np.zeros(products.folds)
    for f in range(products.folds):
        rest_gram, rest_against = gram - products.gram[f], against - products.against[f]
        others = [j for j in range(products.folds) if j != f]
        gained = sum(
            _Ridges.of(rest_gram - products.gram[j], rest_against - products.against[j], precision)
            .taken(products.gram[j], products.against[j], scale)
            for j in others
        )  # fmt: skip
        best = int(np.argmax(gained))
        fitted = _Ridges.of(rest_gram, rest_against, precision)
        own = fitted.taken(products.gram[f], products.against[f], scale)
        inner[f], taken[f] = own, own[best]
    total = float(products.square.sum())
    ridge = float(RIDGES[int(np.argmax(inner.sum(axis=0)))] * scale)
    return HeldOut(float(taken.sum()) / max(total, _LEAST), taken, ridge)


def posterior(products: FoldProducts, precision: Array, ridge: float) -> Posterior:
    """Return mean and covariance of the coefficients, all folds together."""
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    inverse = np.linalg.inv(gram + np.diag(ridge * precision))
    return Posterior(np.asarray(inverse @ against), np.asarray(inverse))


def log_evidence(products: FoldProducts, precision: Array, ridge: float) -> float:
    """Return the log marginal likelihood of the rows over that of x = 0, nats.

    ½ bᵀ(G + λD)⁻¹b − ½ log det(I + (λD)⁻¹G), Rasmussen and Williams 2006, Eq. (2.30).
    """
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    half = 1.0 / np.sqrt(np.maximum(ridge * precision, _LEAST))
    inner = np.eye(len(precision)) + half[:, None] * gram * half[None, :]
    scaled = half * against
    _, log_det = np.linalg.slogdet(inner)
    return 0.5 * float(scaled @ np.linalg.solve(inner, scaled)) - 0.5 * float(log_det)


def _scale(gram: Array, precision: Array) -> float:
    """Mean squared length of a response, each over its prior precision."""
    return float(np.mean(np.diag(gram) / precision)) + _LEAST


@dataclass(frozen=True)
class _Ridges:
    """Coefficients for every ridge from one eigendecomposition: D^(−½) G D^(−½) = Q Λ Qᵀ."""

    values: Array
    vectors: Array
    rotated: Array
    weight: Array

    @classmethod
    def of(cls, gram: Array, against: Array, precision: Array) -> _Ridges:
        w = 1.0 / np.sqrt(precision)
        values, Q = np.linalg.eigh(w[:, None] * gram * w[None, :])
        return cls(np.maximum(values, 0.0), Q, Q.T @ (w * against), w)

    def taken(self, gram: Array, against: Array, scale: float) -> Array:
        """What they take of other rows, for each of `RIDGES`; shape (ridges,)."""
        x = self.rotated[None, :] / (self.values[None, :] + scale * RIDGES[:, None])
        x = (x @ self.vectors.T) * self.weight
        return np.asarray(2.0 * x @ against - np.einsum("ri,ri->r", x @ gram, x))
