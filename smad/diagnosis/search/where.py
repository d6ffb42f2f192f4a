"""Where: the place whose free law takes most of rows that it was not fitted to.

A candidate is a named group of responses: the laws of one place, on spring X, Y or both, or the
parameters. Candidates that take nearly as much are told together, since the runs do not tell them
apart. A second place is sought beside the first, by what both take together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.folds import Array, FoldProducts, Index
from smad.diagnosis.numerics.gaussian import HeldOut, held_out

NEAR = 0.9
"""Candidates that take at least this share of what the best one takes are told beside it."""
MOST_PLACES = 3
LEVEL = 0.05
"""How often a place may be told of a bench that has none."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis of where: `columns` (k,) of the responses, `precision` (k,) of their priors."""

    place: str
    side: str
    columns: Index
    precision: Array

    @property
    def name(self) -> str:
        """As users see it, for example `resistance X`."""
        return f"{self.place} {self.side.upper()}" if self.side in ("x", "y") else self.place


@dataclass(frozen=True)
class Scored:
    """A candidate and what it takes."""

    candidate: Candidate
    held_out: HeldOut

    @property
    def share(self) -> float:
        """Share of the held-out rows' sum of squares that the candidate takes."""
        return self.held_out.share


@dataclass(frozen=True)
class Step:
    """One step of the search: the best candidate beside those before, and who is as good.

    `share` is what all steps so far take together, `near` the candidates that cannot be told from
    the chosen one here, the chosen one first.
    """

    chosen: Candidate
    near: tuple[Candidate, ...]
    share: float


@dataclass(frozen=True)
class Where:
    """`ranked`: every candidate alone, best first. `steps`: places that add to each other."""

    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]


def where(products: FoldProducts, candidates: Sequence[Candidate]) -> Where:
    """Return candidates by held-out share, and the places that add to each other.

    A place enters while what it adds to the held-out rows is significant: by a one-sided t test over
    the folds at `LEVEL`, shared among the candidates that it was the best of (Bonferroni).
    """
    ranked = sorted(
        (Scored(c, held_out(products.only(c.columns), c.precision)) for c in candidates),
        key=lambda s: -s.share,
    )
    steps: list[Step] = []
    taken = np.zeros(products.folds)
    now: list[Candidate] = []
    scored = ranked
    while scored and len(steps) < MOST_PLACES:
        best = scored[0]
        added = best.held_out.taken - taken
        if added.sum() <= _by_chance(added, len(scored)):
            break
        # What stands beside the chosen place is compared by what it adds, not by what all take.
        least = taken.sum() + NEAR * added.sum()
        near = tuple(s.candidate for s in scored if s.held_out.taken.sum() >= least)
        steps.append(Step(best.candidate, near, best.share))
        now.append(best.candidate)
        taken = best.held_out.taken
        rest = [s.candidate for s in ranked if s.candidate not in now]
        scored = sorted((_beside(products, now, c) for c in rest), key=lambda s: -s.share)
    return Where(tuple(ranked), tuple(steps))


def _by_chance(added: Array, candidates: int) -> float:
    """What the best of so many candidates adds by chance, from the spread over the folds."""
    from scipy.stats import t

    folds = len(added)
    quantile = float(t.ppf(1.0 - LEVEL / candidates, folds - 1))
    return quantile * float(np.sqrt(folds) * np.std(added, ddof=1))


def _beside(products: FoldProducts, now: Sequence[Candidate], further: Candidate) -> Scored:
    columns = np.concatenate([c.columns for c in (*now, further)])
    precision = np.concatenate([c.precision for c in (*now, further)])
    return Scored(further, held_out(products.only(columns), precision))
