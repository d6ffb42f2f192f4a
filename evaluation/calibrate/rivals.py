"""The rivals of a case's first step beside its truth, and how likely constants make the right one.

Nothing is replayed: a probability depends on the constants through the kept scores alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from evaluation.names import canonical
from evaluation.score.first_step import RivalScore
from smad.diagnosis.answer import place_probabilities
from smad.diagnosis.constants import Constants
from smad.diagnosis.rivals.rival import tempered_constants
from smad.diagnosis.rivals.score import (
    EFFECT,
    LAW,
    NOTHING,
    PARAMETERS,
    credible_set,
    probabilities,
)
from smad.diagnosis.verdict import DIFFERS

Array = NDArray[np.float64]
NONE, MOVED, LISTED, UNLISTED = "none", "parameters", "listed", "unlisted"
"""What may be true of a case: nothing, other parameters, an effect of the library, another one."""
_PARTS = 5
_ENUMERATED = 4
"""Most runs of which all resamples count: as many as in the product would take hours. A probability
changes by 0.04 at most."""


@dataclass(frozen=True, kw_only=True)
class CaseRivals:
    """The rivals of a case. `fold` is the name of what it is left out with; `exact`: the bench is
    the product's own simulator.

    `names` are the effects at work as keys call them, `places` where the simulator can hold them.
    """

    case: str
    fold: str
    question: str
    exact: bool
    truth: str
    names: frozenset[str]
    places: frozenset[str]
    rivals: tuple[RivalScore, ...]
    independent_rows: float
    effects: int
    laws: int

    @cached_property
    def right(self) -> NDArray[np.bool_]:
        """Which rivals are right, (rivals,): the effect where it is listed, else laws of its place.

        Where the right effect was not refitted, a law of its place is the best there is.
        """
        kind = {NONE: NOTHING, MOVED: PARAMETERS}.get(self.truth)
        if kind is not None:
            return np.array([r.kind == kind for r in self.rivals])
        named = np.array(
            [r.kind == EFFECT and canonical(r.name) in self.names for r in self.rivals]
        )
        laws = np.array([r.kind == LAW and bool(self.places & set(r.places)) for r in self.rivals])
        return named if self.truth == LISTED and named.any() else laws

    @cached_property
    def more(self) -> NDArray[np.bool_]:
        """Which rivals have a part that the simulator lacks, (rivals,)."""
        return np.array([r.kind in (EFFECT, LAW) for r in self.rivals])

    @cached_property
    def lead(self) -> float:
        """What the best rival with a part scores above the best without, over all runs; of an
        effect, the best right one."""
        scores = np.array([sum(r.scores) for r in self.rivals])
        parts = self.right if self.truth in (LISTED, UNLISTED) else self.more
        best = scores[parts].max(initial=-np.inf)
        return float(best - scores[~self.more].max(initial=-np.inf))

    def probability(self, c: Constants) -> Array:
        """The probability of each rival, (rivals,)."""
        constants = tempered_constants(c, free=self.question == DIFFERS)
        return probabilities(
            np.array([r.scores for r in self.rivals]),
            [r.kind for r in self.rivals],
            constants,
            effects=self.effects,
            laws=self.laws,
            log_prior=np.array([r.log_prior for r in self.rivals]),
            rows=self.independent_rows,
            at_floor=[r.near for r in self.rivals],
            by_rows=True,
            enumerated=_ENUMERATED,
        )

    def places_of(self, p: Array) -> dict[str, float]:
        """The probability of each place, from those of the rivals."""
        pairs = list(zip(self.rivals, p.tolist(), strict=True))
        laws = [r.places[0] for r, _ in sorted(pairs, key=lambda x: -x[1]) if r.kind == LAW]
        parts = [(r.places, x) for r, x in pairs if r.kind in (EFFECT, LAW)]
        return place_probabilities(parts, laws)

    def said(self, c: Constants) -> Said:
        """What these constants make of the first step."""
        p = self.probability(c)
        simulator = PARAMETERS if self.question == DIFFERS else NOTHING
        # It may be refuted.
        score = max((sum(r.scores) for r in self.rivals if r.kind == simulator), default=-np.inf)
        nearer = self.more & np.array([sum(r.scores) > score for r in self.rivals])
        allowed = nearer if p[self.more].sum() > 0.5 and nearer.any() else ~self.more
        kind = self.rivals[int(np.argmax(np.where(allowed, p, -1.0)))].kind
        total = max(p[self.more].sum(), 1e-300)
        names = {
            r.name: float(x) / total
            for r, x in zip(self.rivals, p, strict=True)
            if r.kind == EFFECT
        }
        return Said(
            case_rivals=self,
            kind=kind,
            right=float(p[self.right].sum()),
            names=names,
            places=self.places_of(p),
        )


@dataclass(frozen=True, kw_only=True)
class Said:
    """What is said of a case: the kind of the rival that enters, NOTHING where none does.

    `right` is the probability of the right rivals, `names` are those of effects and `places` those
    of places, given that it is an effect or a law.
    """

    case_rivals: CaseRivals
    kind: str
    right: float
    names: Mapping[str, float]
    places: Mapping[str, float]

    @property
    def noticed(self) -> bool:
        """Whether more is said than other parameters."""
        return self.kind in (EFFECT, LAW)

    @property
    def place(self) -> tuple[float, bool]:
        """The probability of the likeliest place, and whether it is right."""
        place = max(self.places, key=lambda x: self.places[x], default="")
        return self.places.get(place, 0.0), place in self.case_rivals.places

    @property
    def name(self) -> tuple[float, bool]:
        """The probability of the likeliest effect, and whether it is right."""
        name = max(self.names, key=lambda x: self.names[x], default="")
        return self.names.get(name, 0.0), canonical(name) in self.case_rivals.names

    def reported_places(self, level: float) -> set[str]:
        """The fewest places that together have the probability `level`."""
        return set(credible_set(self.places, level))

    def reported_places_hold(self, level: float) -> bool:
        """Whether one of these is right."""
        return bool(self.reported_places(level) & self.case_rivals.places)


def showing(cases: Sequence[CaseRivals]) -> list[CaseRivals]:
    """The cases without those whose effect other parameters imitate: whose right rival leads by no
    more than some part does on a bench without an effect, asked the same question."""
    chance: dict[str, float] = {}
    for x in cases:
        if x.truth in (NONE, MOVED):
            chance[x.question] = max(x.lead, chance.get(x.question, 0.0))
    return [x for x in cases if x.truth in (NONE, MOVED) or x.lead > chance.get(x.question, 0.0)]


def folds_of(cases: Sequence[CaseRivals]) -> list[list[CaseRivals]]:
    """The cases in a few parts that are left out in turn; what shares a bench is in one."""
    names = sorted({x.fold for x in cases})
    part = {name: k % _PARTS for k, name in enumerate(names)}
    parts = [[x for x in cases if part[x.fold] == k] for k in range(_PARTS)]
    return [fold for fold in parts if fold]


def apart_from(part: Sequence[CaseRivals], cases: Sequence[CaseRivals]) -> list[CaseRivals]:
    """The cases that share no bench with a part, nor an effect of our simulator: a pair has two."""
    folds = {x.fold for x in part}
    names = {name for x in part if x.exact for name in x.names}
    return [x for x in cases if x.fold not in folds and not (x.exact and x.names & names)]
