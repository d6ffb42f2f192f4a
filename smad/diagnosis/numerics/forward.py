"""Forward selection of a few responses by cross-validation.

Orthogonal matching pursuit (Pati, Rezaiifar and Krishnaprasad 1993) adds, one after the other, the
group of responses that explains most of the residual. It is repeated without each fold, and judged
by what the coefficients explain of that fold.

Rows r (n,) are explained by responses A (k, n) with coefficients x (k,): r ≈ Aᵀx. Every estimate
and its gain on held-out rows follow from AAᵀ and Ar of each fold.
"""

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Index, Singles

_RIDGE = 1e-6
"""Of a response's own square: keeps nearly equal responses apart."""
_SPENT = 1e-4
"""A response is skipped if only this share of its square is independent of those selected."""
_LITTLE = 0.03
"""Least gain of a further group as a share of the whole gain."""
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

    `taken` (depth + 1, f) is the reduction of each fold's sum of squares by the first 0, 1, 2 …
    groups (and the responses that are always in), chosen and fitted without that fold. `chosen` are
    the groups selected with all folds: the fewest that explain nearly the most.
    """

    taken: Array
    chosen: tuple[int, ...]

    @property
    def best(self) -> float:
        """The largest reduction over all held-out folds, in squares of rows."""
        return float(self.taken.sum(axis=1).max())


def forward(
    products: FoldProducts, groups: Index, worth: Array, *, depth: int, before: int = 0
) -> Forward:
    """Select up to `depth` of the groups (m, w), rows of numbers of responses.

    The gain of a group is multiplied by its `worth` (m,), so that of two equal ones the simpler
    enters. The first `before` responses are always in. Chosen groups are ordered by the loss
    without each, the largest first. Raises ValueError for fewer than two folds.
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
    """Groups in the order of selection, each with the largest gain on the residual."""
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
    """The products after these responses are projected out of all others."""
    inner = G[np.ix_(columns, columns)] + np.diag(_RIDGE * size[columns])
    across = np.linalg.solve(inner, G[columns])
    return G - G[:, columns] @ across, b - across.T @ b[columns]
