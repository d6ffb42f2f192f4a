"""Where: the place whose free law takes most of rows that it was not fitted to.

A candidate is a named group of responses: the laws of one place, on spring X, Y or both, or the
parameters. Candidates that take nearly as much are told together, since the runs do not tell them
apart. A second place is sought beside the first, by what both take together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.gaussian import HeldOut, held_out

NEAR = 0.9
"""Candidates that take at least this share of what the best one takes are told beside it."""
MOST_PLACES = 3
LEVEL = 0.05
"""How often a place may be told of a bench that has none."""


@dataclass(frozen=True, eq=False)
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

    @property
    def taken(self) -> float:
        """The same, in squares of rows."""
        return float(self.held_out.taken.sum())


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


def where(rows: FoldRows, candidates: Sequence[Candidate]) -> Where:
    """Return candidates by held-out share, and the places that add to each other.

    A place enters while what it adds to the held-out rows speaks for it: half of that, over the
    variance that a row has with it, is the log predictive density it gains (Geisser 1975). It must
    exceed that of `LEVEL`, shared among the candidates that it was the best of.
    """
    ranked = sorted((_beside(rows, (), c) for c in candidates), key=lambda s: -s.share)
    steps: list[Step] = []
    taken = 0.0
    now: list[Candidate] = []
    scored = ranked
    while scored and len(steps) < MOST_PLACES:
        best = scored[0]
        added = best.taken - taken
        variance = max((rows.square - best.taken) / max(rows.count, 1), 1.0)
        if added / (2.0 * variance) <= np.log(len(scored) / LEVEL):
            break
        # What stands beside the chosen place is compared by what it adds, not by what all take.
        least = taken + NEAR * added
        near = tuple(s.candidate for s in scored if s.taken >= least)
        steps.append(Step(best.candidate, near, best.share))
        now.append(best.candidate)
        taken = best.taken
        rest = [s.candidate for s in ranked if s.candidate not in now]
        scored = sorted((_beside(rows, now, c) for c in rest), key=lambda s: -s.share)
    return Where(tuple(ranked), tuple(steps))


def _beside(rows: FoldRows, now: Sequence[Candidate], further: Candidate) -> Scored:
    columns = np.concatenate([c.columns for c in (*now, further)])
    precision = np.concatenate([c.precision for c in (*now, further)])
    return Scored(further, held_out(rows.of(columns), precision))
