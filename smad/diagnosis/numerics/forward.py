"""Forward selection of few responses, judged on folds that had no part in it.

A law that can be read has few terms, and in most cases the first one is the state that matters.
Orthogonal matching pursuit (Pati, Rezaiifar and Krishnaprasad 1993) adds, one after the other, the
group of responses that takes most of what is left. It is carried out anew without each fold, and
what the coefficients take of that fold is what counts.

Rows r (n,) are explained by responses A (k, n) with coefficients x (k,): r ≈ Aᵀx. Every estimate
and what it takes of held-out rows follow from AAᵀ and Ar of each fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Index, Singles

_RIDGE = 1e-6
"""Of a response's own square: keeps nearly equal responses apart."""
_SPENT = 1e-4
"""A response of which this share or less is new is not asked any more."""
_LITTLE = 0.03
"""A group more must take more than this share of what is taken."""
_TINY = 1e-12


@dataclass(frozen=True)
class FoldProducts:
    """Inner products of f folds and k responses: `gram` (f, k, k) is AAᵀ, `against` (f, k) Ar."""

    gram: Array
    against: Array


@dataclass(frozen=True)
class FoldRows:
    """Rows (n,), responses (k, n) in single precision, and the fold of each row (n,).

    Those whose fold is negative count nowhere. Products are in double precision: single precision
    broke combinations of nearly equal responses.
    """

    rows: Array
    responses: Singles
    fold: Index

    def products(self, columns: Index | slice = slice(None)) -> FoldProducts:
        """The products of some responses, in the order given, or of all."""
        A = self.responses[columns].astype(np.float64)
        k = len(A)
        folds = int(self.fold.max(initial=-1)) + 1
        gram, against = np.zeros((folds, k, k)), np.zeros((folds, k))
        for f in range(folds):
            in_fold = self.fold == f
            part, r = A[:, in_fold], self.rows[in_fold]
            gram[f], against[f] = part @ part.T, part @ r
        return FoldProducts(gram, against)


@dataclass(frozen=True)
class Forward:
    """What was selected.

    `taken` (depth + 1, f) is what each fold's sum of squares loses to the responses that are always
    in and the first 0, 1, 2 … groups, chosen and fitted without that fold (negative where it
    grows). `chosen` are the groups selected with all folds: as few as take nearly the most.
    """

    taken: Array
    chosen: tuple[int, ...]

    @property
    def best(self) -> float:
        """What the best number of groups takes of all held-out folds, in squares of rows."""
        return float(self.taken.sum(axis=1).max())


def forward(
    products: FoldProducts, groups: Index, worth: Array, *, depth: int, before: int = 0
) -> Forward:
    """Select up to `depth` of the groups (m, w), rows of numbers of responses.

    What a group takes counts times its `worth` (m,), so that of two that take the same the simpler
    one enters. The first `before` responses are always in. Of the groups that are chosen, the one
    without which most would be lost comes first. Raises ValueError for fewer than two folds.
    """
    folds = len(products.gram)
    if folds < 2:
        raise ValueError(f"{folds} folds; leaving one out needs 2 or more")
    depth = min(depth, len(groups))
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    taken = np.zeros((depth + 1, folds))
    start = np.arange(before)
    for f in range(folds):
        G, b = gram - products.gram[f], against - products.against[f]
        chosen = _select(G, b, (groups, worth), depth, start)
        for k in range(depth + 1):
            columns = _columns(groups, chosen[:k], start)
            x = _solve(G, b, columns)
            inner_gram = products.gram[f][np.ix_(columns, columns)]
            taken[k, f] = 2.0 * x @ products.against[f][columns] - x @ inner_gram @ x
    sums = taken.sum(axis=1)
    few = int(np.argmax(sums >= sums.max() - _LITTLE * abs(float(sums.max()))))
    selected = _select(gram, against, (groups, worth), few, start)

    def without(group: int) -> float:
        columns = _columns(groups, [g for g in selected if g != group], start)
        return float(against[columns] @ _solve(gram, against, columns))

    return Forward(taken, tuple(sorted(selected, key=without)))


def fitted(products: FoldProducts) -> Array:
    """The coefficients (k,) of the least-squares fit of all responses to all folds."""
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    inverse = np.linalg.inv(gram + np.diag(_RIDGE * np.diag(gram) + _TINY))
    return np.asarray(inverse @ against)


def _columns(groups: Index, chosen: list[int], start: Index) -> Index:
    return np.concatenate([start, groups[chosen].ravel()])


def _solve(G: Array, b: Array, columns: Index) -> Array:
    inner = G[np.ix_(columns, columns)]
    ridge = np.diag(_RIDGE * np.diag(inner) + _TINY)
    return np.asarray(np.linalg.solve(inner + ridge, b[columns]))


def _select(
    G: Array, b: Array, candidates: tuple[Index, Array], depth: int, start: Index
) -> list[int]:
    """The groups in the order in which they take most of what is left."""
    groups, worth = candidates
    size = np.diag(G) + _TINY
    left, r = _without(G, b, start, size) if len(start) else (G, b)
    chosen: list[int] = []
    for _ in range(depth):
        inner = left[groups[:, :, None], groups[:, None, :]]
        diagonal = np.diagonal(inner, axis1=1, axis2=2)
        unused = np.isin(np.arange(len(groups)), chosen, invert=True)
        new = unused & (diagonal > _SPENT * size[groups]).all(axis=1)
        if not bool(new.any()):
            break
        ridge = np.eye(groups.shape[1]) * (_RIDGE * size[groups])[:, None, :]
        rhs = r[groups]
        x = np.linalg.solve(inner + ridge, rhs[:, :, None])[:, :, 0]
        gain = np.where(new, worth * (x * rhs).sum(axis=1), -1.0)
        best = int(np.argmax(gain))
        chosen.append(best)
        left, r = _without(left, r, groups[best], size)
    return chosen


def _without(G: Array, b: Array, columns: Index, size: Array) -> tuple[Array, Array]:
    """The products of what these responses leave of all others."""
    inner = G[np.ix_(columns, columns)] + np.diag(_RIDGE * size[columns])
    across = np.linalg.solve(inner, G[columns])
    return G - G[:, columns] @ across, b - across.T @ b[columns]
