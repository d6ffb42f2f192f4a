"""Inner products of rows and responses by fold: all that linear inference needs of the data.

Rows r (n,) are explained by responses A (k, n) with coefficients x (k,): r ≈ Aᵀx. Every estimate
and what it takes of held-out rows follow from AAᵀ and Ar of each fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class FoldProducts:
    """Inner products of f folds and k responses.

    `gram` (f, k, k) is AAᵀ and `against` (f, k) is Ar of each fold.
    """

    gram: Array
    against: Array

    @property
    def folds(self) -> int:
        """How many folds there are."""
        return len(self.gram)


@dataclass(frozen=True)
class FoldRows:
    """Rows (n,), responses (k, n) in single precision, and the fold of each row (n,).

    Those whose fold is negative count nowhere. Products are in double precision: single precision
    broke combinations of nearly equal responses.
    """

    rows: Array
    responses: NDArray[np.float32]
    fold: Index

    @property
    def folds(self) -> int:
        """How many folds there are."""
        return int(self.fold.max(initial=-1)) + 1

    def products(self, columns: Index | slice = slice(None)) -> FoldProducts:
        """The products of some responses, in the order given, or of all."""
        A = self.responses[columns].astype(np.float64)
        k = len(A)
        gram, against = np.zeros((self.folds, k, k)), np.zeros((self.folds, k))
        for f in range(self.folds):
            in_fold = self.fold == f
            part, r = A[:, in_fold], self.rows[in_fold]
            gram[f], against[f] = part @ part.T, part @ r
        return FoldProducts(gram, against)
