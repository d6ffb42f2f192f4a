"""Inner products of rows and responses by fold: all that linear inference needs of the data.

Rows r (n,) are explained by responses A (k, n) with coefficients x (k,): r ≈ Aᵀx. Every estimate,
its share of held-out rows and its evidence follow from AAᵀ, Ar and rᵀr of each fold, so nothing
else of the rows is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class FoldRows:
    """Rows (n,), responses (k, n) and the number of each row's fold (n,), negative for none."""

    rows: Array
    responses: Array
    fold: Index

    @property
    def count(self) -> int:
        """How many rows are in a fold."""
        return int((self.fold >= 0).sum())

    @property
    def square(self) -> float:
        """Sum of squares of the rows in a fold."""
        kept = self.rows[self.fold >= 0]
        return float(kept @ kept)

    def of(self, columns: Sequence[int] | Index) -> FoldProducts:
        """The products of some responses, in the order given. The rest costs nothing."""
        return fold_products(self.rows, self.responses[np.asarray(columns)], self.fold)


@dataclass(frozen=True)
class FoldProducts:
    """Inner products of f folds and k responses.

    `gram` (f, k, k) is AAᵀ, `against` (f, k) is Ar, `square` (f,) is rᵀr and `count` (f,) how many
    rows each fold has.
    """

    gram: Array
    against: Array
    square: Array
    count: Array

    @property
    def folds(self) -> int:
        """How many folds there are."""
        return len(self.square)


def fold_products(rows: Array, responses: Array, fold: Index) -> FoldProducts:
    """Return the products of `rows` (n,) and `responses` (k, n); `fold` (n,) numbers the folds.

    Rows whose fold is negative count nowhere. In double precision: single precision broke
    combinations of nearly equal responses.
    """
    folds, k = int(fold.max(initial=-1)) + 1, len(responses)
    gram, against = np.zeros((folds, k, k)), np.zeros((folds, k))
    square, count = np.zeros(folds), np.zeros(folds)
    for f in range(folds):
        own = fold == f
        A, r = responses[:, own], rows[own]
        gram[f], against[f], square[f], count[f] = A @ A.T, A @ r, r @ r, len(r)
    return FoldProducts(gram, against, square, count)
