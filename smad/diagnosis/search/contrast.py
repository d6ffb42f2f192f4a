"""What is new in some runs: laws of their own beside laws that all runs share.

The simulator's own form is in every run. A place counts as changed by what a law for the runs in
question alone adds on runs left out, beside a law of the same terms that is common to all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from smad.diagnosis.gap import Residual
from smad.diagnosis.numerics.folds import Array, FoldProducts, FoldRows, Index
from smad.diagnosis.numerics.forward import Forward, fitted, forward
from smad.diagnosis.places.candidate import Candidate
from smad.diagnosis.search.where import Scored, Step, worth_of

_NONE = np.zeros((0, 1), dtype=np.intp)


@dataclass(frozen=True, kw_only=True)
class Contrast:
    """Places whose law is another in the runs in question, the best first, alone and in steps.

    A `share` is of the sum of squares of their rows, `square`. `steps` count beside those before;
    `own` are the rows less what is common, with the responses of the runs in question, from which
    laws of the steps are fitted.
    """

    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]
    own: FoldRows
    square: float


@dataclass(frozen=True)
class _Found:
    scored: Scored
    both: Index
    common: Index


def contrast(
    rows: FoldRows,
    asked: Index,
    candidates: Sequence[Candidate],
    *,
    run_of_row: Index,
    only: Sequence[bool],
    chance: float,
    depth: int,
    most: int,
    first_share: float,
    further_share: float,
    near: float,
) -> Contrast:
    """Return what is new in the rows `asked`.

    `rows` has every response twice, of all runs and of those in question (`fold_rows`). Steps go on
    while the first place adds `first_share` and further ones `further_share`, to at most `most`,
    each of a size in the runs in question (`only`) that the others would have with `chance` at most
    (`by_chance`); those within `near` of
    what the best adds are told with it.
    """
    half = len(rows.responses) // 2
    square = float(rows.rows[asked] @ rows.rows[asked])
    before, steps = np.zeros(0, dtype=np.intp), list[Step]()
    taken = 0.0
    first = found = _ranked(rows, half, before, candidates, depth, square)
    while found and len(steps) < most:
        if found[0].scored.share < (further_share if steps else first_share):
            break
        best = next(
            (
                f
                for f in found
                if f.scored.share >= near * found[0].scored.share
                and by_chance(
                    _own(rows, half, np.union1d(before, f.both), asked), rows, f.scored.columns,
                    run_of_row, only,
                ) <= chance
            ),
            None,
        )  # fmt: skip
        if best is None:
            break
        near_by = tuple(f.scored for f in found if f.scored.share >= near * best.scored.share)
        taken += best.scored.share
        steps.append(Step(best.scored, near_by, taken))
        before = np.unique(np.concatenate([before, best.both]))
        told = {s.chosen.candidate.place for s in steps}
        rest = [c for c in candidates if c.place not in told]
        found = _ranked(rows, half, before, rest, depth, square)
    own = _own(rows, half, before, asked)
    return Contrast(ranked=tuple(f.scored for f in first), steps=tuple(steps), own=own,
                    square=square)  # fmt: skip


def _ranked(
    rows: FoldRows,
    half: int,
    before: Index,
    candidates: Sequence[Candidate],
    depth: int,
    square: float,
) -> list[_Found]:
    found = [_asked(rows, half, before, c, depth, square) for c in candidates]
    return sorted(found, key=lambda f: (-f.scored.share, f.scored.candidate.place))


def _asked(
    rows: FoldRows, half: int, before: Index, c: Candidate, depth: int, square: float
) -> _Found:
    """A law in the runs in question beside one of all runs that has all its terms too."""
    common = _selected(rows, np.union1d(before, c.groups[0]), c, 0, depth)
    shared = np.union1d(np.union1d(before, c.groups[0]), _columns(c, common))
    own = _selected(rows, np.union1d(shared, c.groups[0] + half), c, half, depth)
    shared = np.union1d(shared, _columns(c, own))
    both = np.concatenate([shared, c.groups[0] + half, _columns(c, own) + half])
    added = _held_out(rows, both) - max(_held_out(rows, shared), 0.0)
    return _Found(Scored(c, own, added / max(square, 1e-12)), both, shared)


def _columns(c: Candidate, found: Forward) -> Index:
    return c.groups[[1 + g for g in found.chosen]].ravel()


def _selected(rows: FoldRows, always: Index, c: Candidate, shift: int, depth: int) -> Forward:
    free = np.setdiff1d(np.unique(c.groups[1:] + shift), always)
    groups = [g for g in range(len(c.groups) - 1) if np.isin(c.groups[1 + g] + shift, free).all()]
    if not groups:
        return Forward(np.zeros((1, rows.folds)), ())
    asked = np.searchsorted(free, c.groups[1:][groups] + shift) + len(always)
    worth = worth_of(c)[groups]
    found = forward(rows.products(free, always), asked, worth, depth=depth, before=len(always))
    return replace(found, chosen=tuple(groups[g] for g in found.chosen))


def _held_out(rows: FoldRows, columns: Index) -> float:
    """What these responses take of rows that they were not fitted to."""
    products = rows.products(columns)
    return forward(products, _NONE[:, :1], np.zeros(0), depth=0, before=len(columns)).best


def _own(rows: FoldRows, half: int, columns: Index, asked: Index) -> FoldRows:
    """The rows in question less what is common in the joint fit of these responses."""
    left = rows.rows
    if len(columns):
        x = fitted(rows.products(columns), np.arange(len(columns))).mean
        common = columns < half
        left = left - rows.responses[columns[common]].astype(np.float64).T @ x[common]
    fold = np.full(len(rows.fold), -1, dtype=np.intp)
    names = np.unique(rows.fold[asked])
    fold[asked] = np.searchsorted(names, rows.fold[asked])
    return FoldRows(left, rows.responses[half:], fold)


def by_chance(
    own: FoldRows, rows: FoldRows, columns: Index, run_of_row: Index, only: Sequence[bool]
) -> float:
    """Probability that runs of one kind differ so much in the size of a law.

    The law is fitted to the runs in question (`own`), for each of them without it; its size in a
    run is what of it that run shows. The sizes of both kinds are compared by a t test in which runs
    are what is counted. 0 where one kind has fewer than two runs that show the law.
    """
    A = rows.responses[columns].astype(np.float64)
    products = own.products(columns)
    every = np.arange(len(columns))
    sizes, weights = np.zeros(len(only)), np.zeros(len(only))
    for k in range(len(only)):
        mine = (run_of_row == k) & (rows.fold >= 0)
        kept = ~np.isin(np.arange(products.folds), own.fold[mine])
        part = FoldProducts(products.gram[kept], products.against[kept], products.square[kept])
        shape = A[:, mine].T @ fitted(part if kept.any() else products, every).mean
        weights[k] = shape @ shape
        sizes[k] = shape @ own.rows[mine] / max(weights[k], 1e-12)
    shown = weights > _SHOWN * weights.max()
    now, then = (sizes[shown & (np.array(only) == kind)] for kind in (True, False))
    if min(len(now), len(then)) < 2:
        return 0.0
    return float(stats.ttest_ind(now, then, alternative="greater").pvalue)


_SHOWN = 0.02
"""Of what the run with most of a law shows of it, that another must show to be counted."""


def parameters_share(gap: Residual, moved: Sequence[Array], asked: Index) -> float:
    """Share of the rows in question that other values of the parameters in them take, held out.

    `moved` (k, bins, channels) a run are slopes for one prior standard deviation, 0 elsewhere.
    """
    own = FoldRows(gap.z, gap.rows(moved).astype(np.float32), gap.fold)
    products = own.products(np.arange(len(own.responses)))
    taken = with_priors(products, np.unique(gap.fold[asked]))
    square = float(gap.z[asked] @ gap.z[asked])
    return taken / max(square, 1e-12)


def with_priors(products: FoldProducts, folds: Index) -> float:
    """What responses with coefficients of prior variance 1 take of some folds, held out."""
    gram, against = products.gram.sum(axis=0), products.against.sum(axis=0)
    taken, unit = 0.0, np.eye(len(against))
    for f in folds:
        G, b = products.gram[f], products.against[f]
        x = np.linalg.solve(gram - G + unit, against - b)
        taken += float(2.0 * x @ b - x @ G @ x)
    return taken


def apart(rows: FoldRows, run_of_row: Index, columns: Sequence[Index], run: int) -> float:
    """Share of a run's rows that coefficients of its own would take beyond those of the others.

    Stretches of the run are predicted from its other stretches, or from all the rest. The best of
    several sets of `columns` counts.
    """
    mine = (run_of_row == run) & (rows.fold >= 0)
    at = np.flatnonzero(mine)
    square = float(rows.rows[at] @ rows.rows[at])
    block = np.full(len(mine), -1)
    block[at] = (np.arange(len(at)) * _BLOCKS * 2) // max(len(at), 1) % _BLOCKS
    best = 0.0
    for own in columns:
        A = rows.responses[own].astype(np.float64)
        rest = (rows.fold >= 0) & ~mine
        others = _products(A, rows.rows, rest)
        whole = _products(A, rows.rows, mine)
        gain = 0.0
        for b in range(_BLOCKS):
            asked = block == b
            G, g = _products(A, rows.rows, asked)
            pooled = _solved(others[0] + whole[0] - G, others[1] + whole[1] - g)
            alone = pooled + _solved(
                whole[0] - G, whole[1] - g - (whole[0] - G) @ pooled, ridge=others[0]
            )
            gain += float(2 * alone @ g - alone @ G @ alone - 2 * pooled @ g + pooled @ G @ pooled)
        best = max(best, gain / max(square, 1e-12))
    return best


_BLOCKS = 4
_SHRUNK = 0.05
"""How much a run's own coefficients lean on the others', of a run's own weight."""


def _products(A: Array, r: Array, rows: Array) -> tuple[Array, Array]:
    part = A[:, rows]
    return part @ part.T, part @ r[rows]


def _solved(G: Array, b: Array, ridge: Array | None = None) -> Array:
    more = 0.0 if ridge is None else _SHRUNK * np.diag(np.diag(ridge))
    return np.asarray(
        np.linalg.solve(G + more + 1e-6 * np.diag(np.diag(G)) + 1e-9 * np.eye(len(b)), b)
    )
