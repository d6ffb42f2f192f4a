"""What is new in some runs: laws of their own beside laws that all runs share.

The simulator's own form is in every run. A place counts as changed by what a law for the runs in
question alone adds on runs left out, beside a law of the same terms that is common to all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from smad.diagnosis.constants import Constants
from smad.diagnosis.gap import Residual
from smad.diagnosis.numerics.folds import Array, FoldProducts, FoldRows, Index
from smad.diagnosis.numerics.forward import Forward, fitted, forward
from smad.diagnosis.places.candidate import Candidate
from smad.diagnosis.search.names import LIST_GAIN, Naming
from smad.diagnosis.search.where import (
    MOST_PLACES,
    MOST_TERMS,
    WORTH_TELLING,
    Scored,
    Step,
    left_out,
    step_of,
    without_named,
    worth_of,
    worth_of_side,
)

CHANCE = 0.01
"""Runs of one kind differ as much with this probability at most."""
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
    constants: Constants,
    *,
    run_of_row: Index,
    only: Sequence[bool],
    worth: float = WORTH_TELLING,
    naming: Naming | None = None,
) -> Contrast:
    """Return what is new in the rows `asked`.

    `rows` has every response twice, of all runs and of those in question (`fold_rows`). Steps go on
    while a place adds a share `worth` telling, to at most `MOST_PLACES`, each of a size in the runs
    in question (`only`) that the others would have with `CHANCE` at most (`by_chance`).
    """
    square = float(rows.rows[asked] @ rows.rows[asked])
    search = _Search(rows, asked, max(square, 1e-12))
    before, steps, taken = np.zeros(0, dtype=np.intp), list[Step](), 0.0
    first = found = search.ranked(before, candidates)
    while found and len(steps) < MOST_PLACES:
        by_scored = {id(f.scored): f for f in found}
        scored = [f.scored for f in found]

        def gains(one: Scored, own: dict[int, _Found] = by_scored) -> Array:
            return search.gains(own[id(one)])

        left = search.own(before)
        left = replace(left, rows=np.where(left.fold >= 0, left.rows, 0.0))
        step = step_of(
            scored, constants, taken=0.0, size=search.square, naming=naming, gains=gains,
            noise=LIST_GAIN, left=left,
        )  # fmt: skip
        if step.share < worth:
            break
        both = by_scored[id(step.chosen)].both
        own = search.own(np.union1d(before, both))
        if by_chance(own, rows, step.chosen.columns, run_of_row, only) > CHANCE:
            break
        taken += step.share
        steps.append(replace(step, share=taken))
        before = np.unique(np.concatenate([before, both]))
        naming = without_named(naming, step)
        told = {s.chosen.candidate.place for s in steps}
        found = search.ranked(before, [c for c in candidates if c.place not in told])
    return Contrast(
        ranked=tuple(f.scored for f in first), steps=tuple(steps), own=search.own(before),
        square=square,
    )  # fmt: skip


@dataclass(frozen=True)
class _Search:
    """Candidates beside responses that are always in; `square` is that of the rows `asked`."""

    rows: FoldRows
    asked: Index
    square: float

    @property
    def half(self) -> int:
        """From here on responses are of the runs in question alone."""
        return len(self.rows.responses) // 2

    def ranked(self, before: Index, candidates: Sequence[Candidate]) -> list[_Found]:
        """All candidates, the best first."""
        found = [self._found(before, c) for c in candidates]
        return sorted(found, key=lambda f: (-worth_of_side(f.scored), f.scored.candidate.place))

    def gains(self, found: _Found) -> Array:
        """What a law in the runs in question takes of each channel of these, held out."""
        shared, both = left_out(self.rows, found.common), left_out(self.rows, found.both)
        return self._own.by_channel(shared) - self._own.by_channel(both)

    def own(self, columns: Index) -> FoldRows:
        """The rows in question less what is common in the joint fit of these responses."""
        rows, left = self.rows, self.rows.rows
        if len(columns):
            x = fitted(rows.products(columns), np.arange(len(columns))).mean
            common = columns < self.half
            left = left - rows.responses[columns[common]].astype(np.float64).T @ x[common]
        return replace(self._own, rows=left)

    @cached_property
    def _own(self) -> FoldRows:
        """The rows in question, with the responses of these runs alone."""
        rows, fold = self.rows, np.full(len(self.rows.fold), -1, dtype=np.intp)
        names = np.unique(rows.fold[self.asked])
        fold[self.asked] = np.searchsorted(names, rows.fold[self.asked])
        return FoldRows(rows.rows, rows.responses[self.half :], fold, rows.channels)

    def _found(self, before: Index, c: Candidate) -> _Found:
        """A law in the runs in question beside one of all runs that has all its terms too."""
        half = self.half
        common = self._selected(np.union1d(before, c.groups[0]), c, 0)
        shared = np.union1d(np.union1d(before, c.groups[0]), _columns(c, common))
        own = self._selected(np.union1d(shared, c.groups[0] + half), c, half)
        shared = np.union1d(shared, _columns(c, own))
        both = np.concatenate([shared, c.groups[0] + half, _columns(c, own) + half])
        added = self._held_out(both) - max(self._held_out(shared), 0.0)
        return _Found(Scored(c, own, added / self.square), both, shared)

    def _selected(self, always: Index, c: Candidate, shift: int) -> Forward:
        free = np.setdiff1d(np.unique(c.groups[1:] + shift), always)
        groups = [
            g for g in range(len(c.groups) - 1) if np.isin(c.groups[1 + g] + shift, free).all()
        ]
        if not groups:
            return Forward(np.zeros((1, self.rows.folds)), ())
        asked = np.searchsorted(free, c.groups[1:][groups] + shift) + len(always)
        products = self.rows.products(free, always)
        worth = worth_of(c)[groups]
        found = forward(products, asked, worth, depth=MOST_TERMS, before=len(always))
        return replace(found, chosen=tuple(groups[g] for g in found.chosen))

    def _held_out(self, columns: Index) -> float:
        """What these responses take of rows that they were not fitted to."""
        products = self.rows.products(columns)
        return forward(products, _NONE, np.zeros(0), depth=0, before=len(columns)).best


def _columns(c: Candidate, found: Forward) -> Index:
    return c.groups[[1 + g for g in found.chosen]].ravel()


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
        part = products.without(*np.unique(own.fold[mine & (own.fold >= 0)]))
        shape = A[:, mine].T @ fitted(part if part.folds else products, every).mean
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
