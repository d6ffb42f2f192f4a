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
from smad.diagnosis.answer import place_probabilities
from smad.diagnosis.constants import Constants
from smad.diagnosis.rivals.score import (
    EFFECT,
    LAW,
    NOTHING,
    PARAMETERS,
    Temper,
    credible_set,
    probabilities,
)
from smad.diagnosis.verdict import RivalScore

Array = NDArray[np.float64]
NONE, MOVED, LISTED, UNLISTED = "none", "parameters", "listed", "unlisted"
"""What may be true of a case: nothing, other parameters, an effect of the library, another one."""
_LEAD = 1.0
"""Scores (log squares, over all runs and channels) that a right rival must lead by to be told."""
_PARTS = 5


@dataclass(frozen=True, kw_only=True)
class Asked:
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
    def hidden(self) -> bool:
        """Whether an effect is at work that the simulator imitates without one."""
        scores = np.array([sum(r.scores) for r in self.rivals])
        same = np.array([r.kind in (NOTHING, PARAMETERS) for r in self.rivals])
        best = scores[self.right].max(initial=-np.inf)
        return self.truth in (LISTED, UNLISTED) and bool(best < scores[same].max() + _LEAD)

    def probability(self, c: Constants) -> Array:
        """The probability of each rival, (rivals,)."""
        temper = Temper(evidence=c.evidence, nothing=c.nothing, parameters=c.parameters,
                        effect=c.effect, law=0.0)  # fmt: skip
        return probabilities(
            np.array([r.scores for r in self.rivals]), [r.kind for r in self.rivals], temper,
            effects=self.effects, laws=self.laws,
            log_prior=np.array([r.log_prior for r in self.rivals]),
        )  # fmt: skip

    def said(self, c: Constants) -> Said:
        """What these constants make of the first step."""
        p = self.probability(c)
        same = [r.gap for r in self.rivals if r.kind in (NOTHING, PARAMETERS)]
        kind = NOTHING
        for k in np.argsort(-p, kind="stable"):
            rival = self.rivals[k]
            if rival.kind in (NOTHING, PARAMETERS) or rival.gap < min(same):
                kind = rival.kind
                break
        parts = [(r, float(x)) for r, x in zip(self.rivals, p, strict=True)
                 if r.kind in (EFFECT, LAW)]  # fmt: skip
        total = max(sum(x for _, x in parts), 1e-300)
        names = {r.name: x / total for r, x in parts if r.kind == EFFECT}
        return Said(asked=self, kind=kind, right=float(p[self.right].sum()), names=names,
                    places=place_probabilities(parts))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Said:
    """What is said of a case: the kind of the rival that enters, NOTHING where none does.

    `right` is the probability of the right rivals, `names` are those of effects and `places` those
    of places, given that it is an effect or a law.
    """

    asked: Asked
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
        return self.places.get(place, 0.0), place in self.asked.places

    @property
    def name(self) -> tuple[float, bool]:
        """The probability of the likeliest effect, and whether it is right."""
        name = max(self.names, key=lambda x: self.names[x], default="")
        return self.names.get(name, 0.0), canonical(name) in self.asked.names

    def told_places(self, level: float) -> set[str]:
        """The fewest places that together have the probability `level`."""
        return set(credible_set(self.places, level))

    def told_places_hold(self, level: float) -> bool:
        """Whether one of these is right."""
        return bool(self.told_places(level) & self.asked.places)


def folds_of(cases: Sequence[Asked]) -> list[list[Asked]]:
    """The cases in a few parts that are left out in turn; what shares a bench is in one."""
    names = sorted({x.fold for x in cases})
    part = {name: k % _PARTS for k, name in enumerate(names)}
    parts = [[x for x in cases if part[x.fold] == k] for k in range(_PARTS)]
    return [some for some in parts if some]
