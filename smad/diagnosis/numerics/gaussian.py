"""Linear-Gaussian inference from inner products: r = Aᵀx + e, e ~ N(0, vI), x ~ N(0, v(λD)⁻¹).

D is the diagonal of prior precisions of the responses (1 is a main effect, more is shrunk more),
λ the ridge, v the variance of a row. Ridge and variance are those of the largest evidence (type-II
maximum likelihood, MacKay 1992). What responses take of a fold is measured with coefficients,
ridge and variance of the other folds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.folds import Array, FoldProducts

RIDGES: Array = np.geomspace(1e-7, 1e4, 34)
"""Ridges that are tried, in mean squared lengths of the responses."""
_LEAST = 1e-12


@dataclass(frozen=True)
class HeldOut:
    """What responses take of rows that they were not fitted to.

    `taken` (f,) is what each fold's sum of squares loses to coefficients of the other folds
    (negative where it grows), `share` their sum over the sum of squares of all folds, `ridge` that
    of all folds together.
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

    Raises ValueError for fewer than two folds.
    """
    if products.folds < 2:
        raise ValueError(f"{products.folds} folds; leaving one out needs 2 or more")
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    square, count = float(products.square.sum()), float(products.count.sum())
    taken = np.zeros(products.folds)
    for f in range(products.folds):
        rest = _Spectrum.of(gram - products.gram[f], against - products.against[f], precision)
        ridge = rest.ridge(square - products.square[f], count - products.count[f])
        x = rest.coefficients(ridge)
        taken[f] = 2.0 * x @ products.against[f] - x @ products.gram[f] @ x
    whole = _Spectrum.of(gram, against, precision).ridge(square, count)
    return HeldOut(float(taken.sum()) / max(square, _LEAST), taken, whole)


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


@dataclass(frozen=True)
class _Spectrum:
    """D^(−½) G D^(−½) = Q Λ Qᵀ, from which coefficients and evidence of every ridge follow."""

    values: Array
    vectors: Array
    rotated: Array
    weight: Array

    @classmethod
    def of(cls, gram: Array, against: Array, precision: Array) -> _Spectrum:
        w = 1.0 / np.sqrt(precision)
        values, Q = np.linalg.eigh(w[:, None] * gram * w[None, :])
        return cls(np.maximum(values, 0.0), Q, Q.T @ (w * against), w)

    def ridge(self, square: float, count: float) -> float:
        """Return the ridge of the largest evidence, the rows' variance at its own maximum.

        −½ Σ log(1 + Λᵢ/λ) − ½ n log(rᵀr − Σ (Qᵀb)ᵢ²/(Λᵢ + λ)).
        """
        ridges = RIDGES * (float(self.values.mean()) + _LEAST)
        summed = self.values[None, :] + ridges[:, None]
        left = np.maximum(square - (self.rotated**2 / summed).sum(axis=1), _LEAST)
        determinant = np.log(summed / ridges[:, None]).sum(axis=1)
        return float(ridges[int(np.argmin(determinant + count * np.log(left)))])

    def coefficients(self, ridge: float) -> Array:
        """Return the mean of the coefficients, shape (k,)."""
        return np.asarray(self.weight * (self.vectors @ (self.rotated / (self.values + ridge))))
