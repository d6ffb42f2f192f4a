"""Where: the place whose law takes most of rows that it was not fitted to.

A candidate is a place on spring X, Y or both, with the terms that its law may have. Of each a law
of a few terms is selected and judged by leaving runs out. Candidates that take nearly as much are
told together, since the runs do not tell them apart. A further place is sought beside those before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.numerics.folds import Array, FoldProducts, FoldRows, Index
from smad.diagnosis.numerics.forward import Fit, Forward, fitted, forward
from smad.diagnosis.places.candidate import Candidate

_SIMPLER = 0.97
"""What a term of one order more is worth."""


@dataclass(frozen=True)
class Scored:
    """A candidate and the law that was selected: `share` of the held-out rows' sum of squares."""

    candidate: Candidate
    forward: Forward
    share: float

    @property
    def terms(self) -> tuple[str, ...]:
        """The law's terms, the one without which most would be lost first, the constant last."""
        return tuple(self.candidate.terms[g] for g in self._groups)

    @property
    def columns(self) -> Index:
        """Numbers of the law's responses, term by term."""
        return self.candidate.groups[list(self._groups)].ravel()

    @property
    def _groups(self) -> tuple[int, ...]:
        return (*(1 + g for g in self.forward.chosen), 0)


@dataclass(frozen=True)
class Step:
    """One step of the search: the best candidate beside those before, and who is as good.

    `share` is what all steps so far take together; `near` begins with the chosen one.
    """

    chosen: Scored
    near: tuple[Scored, ...]
    share: float


@dataclass(frozen=True)
class Where:
    """`ranked`: every candidate alone, best first. `steps`: places that add to each other."""

    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Fits:
    """The responses `columns` (k,) fitted to all folds, and coefficients without each fold."""

    columns: Index
    fit: Fit
    without: tuple[Array, ...]


def where(rows: FoldRows, candidates: Sequence[Candidate], constants: Constants) -> Where:
    """Return candidates by held-out share, and the places that add to each other.

    A place enters while what it adds to the held-out rows speaks for it: half of that, over the
    variance that a row has with it, is the log predictive density it gains (Geisser 1975). It must
    exceed `place_gain` and take `place_share` of the rows. What many places would add alike is
    said of none of them.
    """
    nothing = np.zeros(0, dtype=np.intp)
    ranked = _scored(rows, nothing, candidates, 0.0, constants)
    steps: list[Step] = []
    now, taken, scored = nothing, 0.0, ranked
    while scored and len(steps) < constants.most_places:
        best = scored[0]
        added = best.share * rows.square - taken
        variance = max((rows.square - taken - added) / max(rows.count, 1), 1.0)
        enough = added / (2.0 * variance) > constants.place_gain
        if not enough or added < constants.place_share * rows.square:
            break
        # What stands beside the chosen place is compared by what it adds, not by what all take.
        least = taken + constants.near * added
        near = tuple(s for s in scored if s.share * rows.square >= least)
        if steps and len({s.candidate.place for s in near}) > constants.most_places:
            break
        steps.append(Step(best, near, best.share))
        now, taken = np.concatenate([now, best.columns]), taken + added
        told = {s.chosen.candidate.place for s in steps}
        rest = [c for c in candidates if c.place not in told]
        scored = _scored(rows, now, rest, taken, constants)
    return Where(ranked, tuple(steps))


def _scored(
    rows: FoldRows,
    before: Index,
    candidates: Sequence[Candidate],
    taken: float,
    constants: Constants,
) -> tuple[Scored, ...]:
    """Candidates beside the responses `before`, best first."""
    out = []
    for c in candidates:
        always = np.setdiff1d(c.groups[0], before)
        free = np.setdiff1d(np.unique(c.groups[1:]), always)
        start = np.concatenate([before, always])
        products = rows.products(free, start)
        groups = len(start) + np.searchsorted(free, c.groups[1:])
        found = forward(
            products, groups, worth_of(c), depth=constants.most_terms, before=len(start)
        )
        out.append(Scored(c, found, max(found.best, taken) / max(rows.square, 1e-12)))
    return tuple(sorted(out, key=lambda s: (-s.share, s.candidate.place, s.candidate.side)))


def worth_of(c: Candidate) -> Array:
    """What each term but the constant is worth: simpler ones go first."""
    return np.asarray(_SIMPLER ** (np.array(c.orders[1:]) - 1.0))


def fits(rows: FoldRows, steps: Sequence[Step]) -> Fits:
    """The laws of these steps fitted together."""
    columns = np.concatenate([s.chosen.columns for s in steps])
    products = rows.products(columns)
    every = np.arange(len(columns))
    without = []
    for f in range(products.folds):
        keep = np.arange(products.folds) != f
        part = FoldProducts(products.gram[keep], products.against[keep], products.square[keep])
        without.append(fitted(part, every).mean)
    return Fits(columns, fitted(products, every), tuple(without))
