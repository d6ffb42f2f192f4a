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
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.forward import fitted, held_out
from smad.diagnosis.places.responses import Candidate
from smad.diagnosis.search.names import LIST_GAIN, Naming
from smad.diagnosis.search.where import (
    MOST_PLACES,
    WORTH_TELLING,
    Scored,
    Step,
    left_out,
    not_told,
    selected,
    step_of,
    without_named,
    worth_of_side,
)

CHANCE = 0.01
"""Runs of one kind differ as much with this probability at most."""


@dataclass(frozen=True, kw_only=True)
class Contrast:
    """Places whose law is another in the runs in question, the best first, alone and in steps.

    A `share` is of the sum of squares of their rows. `steps` count beside those before; `own` are
    the rows less what is common, with the responses of the runs in question, from which laws of the
    steps are fitted.
    """

    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]
    own: FoldRows


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
    search = _Search(rows, asked, max(float(rows.rows[asked] @ rows.rows[asked]), 1e-12))
    before, steps, taken = np.zeros(0, dtype=np.intp), list[Step](), 0.0
    first = found = search.ranked(before, candidates)
    while found and len(steps) < MOST_PLACES:
        best: dict[str, _Found] = {}
        for f in found:
            best.setdefault(f.scored.candidate.place, f)
        left = search.own(before)
        step = step_of(
            [f.scored for f in best.values()], [search.gains(f) for f in best.values()], constants,
            taken=0.0, size=search.square, naming=naming, noise=LIST_GAIN,
            left=replace(left, rows=np.where(left.fold >= 0, left.rows, 0.0)),
        )  # fmt: skip
        if step.share < worth:
            break
        both = np.union1d(before, best[step.chosen.candidate.place].both)
        if by_chance(search.own(both), rows, step.chosen.columns, run_of_row, only) > CHANCE:
            break
        taken += step.share
        steps.append(replace(step, share=taken))
        before = both
        naming = without_named(naming, step)
        found = search.ranked(before, not_told(candidates, steps))
    ranked = tuple(f.scored for f in first)
    return Contrast(ranked=ranked, steps=tuple(steps), own=search.own(before))


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
        rows, common = self.rows, columns < self.half
        x = fitted(rows.products(columns)).mean
        left = rows.rows - rows.responses[columns[common]].astype(np.float64).T @ x[common]
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
        half, always = self.half, np.union1d(before, c.groups[0])
        common = selected(self.rows, always, c)
        shared = np.union1d(always, Scored(c, common, 0.0).columns)
        own = selected(self.rows, np.union1d(shared, c.groups[0] + half), c, half)
        law = Scored(c, own, 0.0)
        shared = np.union1d(shared, law.columns)
        both = np.concatenate([shared, law.columns + half])
        every = np.arange(self.rows.folds)
        taken, known = (held_out(self.rows.products(x), every) for x in (both, shared))
        added = taken - max(known, 0.0)
        return _Found(replace(law, share=added / self.square), both, shared)


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
    sizes, weights = np.zeros(len(only)), np.zeros(len(only))
    for k in range(len(only)):
        mine = (run_of_row == k) & (rows.fold >= 0)
        part = products.without(*np.unique(own.fold[mine & (own.fold >= 0)]))
        shape = A[:, mine].T @ fitted(part if part.folds else products).mean
        weights[k] = shape @ shape
        sizes[k] = shape @ own.rows[mine] / max(weights[k], 1e-12)
    shown = weights > _SHOWN * weights.max()
    now, then = (sizes[shown & (np.array(only) == kind)] for kind in (True, False))
    if min(len(now), len(then)) < 2:
        return 0.0
    return float(stats.ttest_ind(now, then, alternative="greater").pvalue)


_SHOWN = 0.02
"""Of what the run with most of a law shows of it, that another must show to be counted."""


def apart(rows: FoldRows, run_of_row: Index, columns: Sequence[Index], run: int) -> float:
    """Share of a run's rows that coefficients of its own would take beyond those of the others.

    Stretches of the run are predicted from its other stretches, or from all the rest. The best of
    several sets of `columns` counts.
    """
    at = np.flatnonzero((run_of_row == run) & (rows.fold >= 0))
    square = float(rows.rows[at] @ rows.rows[at])
    block = np.where(rows.fold >= 0, _BLOCKS, -1)
    block[at] = (np.arange(len(at)) * _BLOCKS * 2) // max(len(at), 1) % _BLOCKS
    best = 0.0
    for own in columns:
        products = replace(rows, fold=block).products(own)
        *grams, G_others = products.gram
        *againsts, g_others = products.against
        gain = 0.0
        for G, g in zip(grams, againsts, strict=True):
            rest_G, rest_g = np.sum(grams, axis=0) - G, np.sum(againsts, axis=0) - g
            pooled = _solved(G_others + rest_G, g_others + rest_g)
            alone = pooled + _solved(rest_G, rest_g - rest_G @ pooled, ridge=G_others)
            gain += float(2 * alone @ g - alone @ G @ alone - 2 * pooled @ g + pooled @ G @ pooled)
        best = max(best, gain / max(square, 1e-12))
    return best


_BLOCKS = 4
_SHRUNK = 0.05
"""How much a run's own coefficients lean on the others', of a run's own weight."""


def _solved(G: Array, b: Array, ridge: Array | None = None) -> Array:
    more = 0.0 if ridge is None else _SHRUNK * np.diag(np.diag(ridge))
    return np.asarray(
        np.linalg.solve(G + more + 1e-6 * np.diag(np.diag(G)) + 1e-9 * np.eye(len(b)), b)
    )
