"""A hypothesis of where the model must change."""

from __future__ import annotations

from dataclasses import dataclass

from smad.diagnosis.numerics.folds import Index


@dataclass(frozen=True, eq=False)
class Candidate:
    """A hypothesis of where: a place, a side, and the terms that a law may have there.

    `groups` (m, w) are the numbers of a term's responses, one for each spring that it acts on;
    `terms` (m,) their names. The first is the constant, which is in every law: the lines of the
    others have their zero in the middle of the state's range. `orders` (m,) are theirs: 1 for a
    line, more for what is less simple.
    """

    place: str
    side: str
    groups: Index
    terms: tuple[str, ...]
    orders: tuple[int, ...]
