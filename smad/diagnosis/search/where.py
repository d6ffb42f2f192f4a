"""Where: the place whose law takes most of rows that it was not fitted to.

A candidate is a place on spring X, Y or both, with the terms that its law may have. Of each a law
of a few terms is selected and judged by leaving runs out. Candidates that take nearly as much are
told together, since the runs do not tell them apart. A further place is sought beside those before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.numerics.folds import Array, FoldProducts, FoldRows, Index
from smad.diagnosis.numerics.forward import Fit, Forward, fitted, forward
from smad.diagnosis.places.candidate import Candidate
from smad.diagnosis.search.names import Naming, score
from smad.diagnosis.search.refine import Refined

_SIMPLER = 0.97
"""What a term of one order more is worth."""


@dataclass(frozen=True)
class Scored:
    """A candidate and the law that was selected: its `share` of held-out rows, beside others."""

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


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of the search: the best candidate beside those before, and who is as good.

    `share` is what all steps so far take together; `near` begins with the chosen one. `entry` is
    the effect of the library that acts there and takes most, `takes` that over what the law takes.
    `worth` is what the best of laws and effects adds.
    """

    chosen: Scored
    near: tuple[Scored, ...]
    share: float
    worth: float
    entry: Refined | None = None
    takes: float = 0.0
    named: bool = False


@dataclass(frozen=True)
class Where:
    """`ranked`: every candidate alone, best first. `steps`: places that add to each other. Shares
    are of `size`, in squares of rows."""

    size: float
    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Fits:
    """The responses `columns` (k,) fitted to all folds, and coefficients without each fold."""

    columns: Index
    fit: Fit
    without: tuple[Array, ...]


def where(
    rows: FoldRows,
    candidates: Sequence[Candidate],
    constants: Constants,
    *,
    least: float,
    naming: Naming | None = None,
    size: float | None = None,
    effects_stand: bool = False,
) -> Where:
    """Return candidates by held-out share, and the places that add to each other.

    Shares are of `size`, the rows' sum of squares, or what of it a bench without a change lacks;
    of what the best law takes, where that is more.
    A place enters while what it adds to the held-out rows speaks for it: over the variance that a
    row has with it, that is twice the log predictive density it gains (Geisser 1975). It must
    exceed `least` and take `place_share`. What many places would add alike is said of none.
    Later places are beside the law of one before, or with `effects_stand` beside its effect, where
    that is named.
    """
    now, steps, taken = np.zeros(0, dtype=np.intp), list[Step](), 0.0
    left, entries = rows, 0.0
    alone = _scored(left, now, candidates, constants, size=1.0)
    size = max(rows.square if size is None else size, alone[0].share if alone else 0.0, 1e-12)
    ranked = scored = tuple(replace(s, share=s.share / size) for s in alone)
    while scored and len(steps) < constants.most_places:
        step = step_of(
            scored, constants, taken=taken, size=size, naming=naming, left=_beside(left, now),
            effects_stand=effects_stand,
        )  # fmt: skip
        variance = max((rows.square - step.share * size) / max(rows.count, 1), 1.0)
        if step.worth * size < max(least * variance, constants.place_share * size):
            break
        if steps and len({s.candidate.place for s in step.near}) > constants.most_places:
            break
        steps.append(step)
        taken = step.share
        if effects_stand and step.named and step.entry is not None:
            entries += step.entry.gain / size
            left = replace(left, rows=left.rows - step.entry.change)
        else:
            now = np.concatenate([now, step.chosen.columns])
        naming = without_named(naming, step)
        told = {s.chosen.candidate.place for s in steps}
        rest = [c for c in candidates if c.place not in told]
        scored = _scored(left, now, rest, constants, size=size, before=entries, least=taken)
    return Where(size, ranked, tuple(steps))


def step_of(
    scored: Sequence[Scored],
    constants: Constants,
    *,
    taken: float,
    size: float,
    naming: Naming | None,
    left: Array,
    effects_stand: bool = False,
) -> Step:
    """The step that the best law makes, or the best effect of the library.

    A law is linear in the responses and has few terms. An effect has the form that a cause has, and
    is replayed: where it takes `entry_share` of what the best law of any place takes, one that says
    where it acts says which place it is. It is the name when it takes `name_share` of that and
    `name_size` of all that is left.
    """
    best = scored[0]
    added = best.share - taken
    entry = None if naming is None else naming.best(left)
    gain = 0.0 if entry is None else score(entry) / size
    places = entry.effects[0].places if entry is not None else ()
    own = [s for s in scored if s.candidate.place in places]
    by_entry = bool(own) and gain >= constants.entry_share * added
    enough = max(constants.name_share * added, constants.name_size * (1.0 - taken))
    named = (by_entry or not places) and 0.0 < gain >= enough
    chosen, worth = (own[0], max(gain, added)) if by_entry else (best, added)
    least = taken + constants.near * worth
    near = (chosen, *(s for s in scored if s is not chosen and s.share >= least))
    if naming is not None and not (by_entry or named):
        entry = naming.best(left, {s.candidate.place for s in near})
        gain = 0.0 if entry is None else score(entry) / size
    law = max(chosen.share - taken, 0.0)
    return Step(
        chosen=chosen, near=near, worth=worth,
        share=taken + (max(gain, law) if named and effects_stand else law),
        entry=entry, takes=gain / max(law, 1e-3 * gain, 1e-12), named=named,
    )  # fmt: skip


def without_named(naming: Naming | None, step: Step) -> Naming | None:
    """The effects that may still be named: one that says where it acts is told once."""
    entry = step.entry
    if naming is None or entry is None or not (step.named and entry.effects[0].places):
        return naming
    return naming.without(entry.names[0])


def _beside(rows: FoldRows, columns: Index) -> Array:
    """The rows less what these responses take of them."""
    if not len(columns):
        return rows.rows
    x = fitted(rows.products(columns), np.arange(len(columns))).mean
    return np.asarray(rows.rows - rows.responses[columns].astype(np.float64).T @ x)


def _scored(
    rows: FoldRows,
    now: Index,
    candidates: Sequence[Candidate],
    constants: Constants,
    *,
    size: float,
    before: float = 0.0,
    least: float = 0.0,
) -> tuple[Scored, ...]:
    """Candidates beside the responses `now`, best first; `before` was taken off the rows."""
    out = []
    for c in candidates:
        always = np.setdiff1d(c.groups[0], now)
        free = np.setdiff1d(np.unique(c.groups[1:]), always)
        start = np.concatenate([now, always])
        products = rows.products(free, start)
        groups = len(start) + np.searchsorted(free, c.groups[1:])
        found = forward(
            products, groups, worth_of(c), depth=constants.most_terms, before=len(start)
        )
        out.append(Scored(c, found, max(before + found.best / size, least)))
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
