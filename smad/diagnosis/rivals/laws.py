"""Laws as rivals: for each place the few terms that take most of rows they were not fitted to.

Terms are selected on the linear picture at a reference, with the parameters open beside them; what
is selected is then fitted and judged by replay like any other rival.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.forward import Forward, fitted, forward
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Candidate, Responses, candidate_laws, responses
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference, weights
from smad.diagnosis.rivals.parts import LawPart
from smad.diagnosis.rivals.screening import opened
from smad.progress import Say, silent

MOST_TERMS = 3
"""Terms of a law at most, so that it can be read."""
_SIMPLER = 0.97
"""What a term of one order more is worth, and a law on both springs beside one on either."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SelectedLaw:
    """The law of a place: coefficients to begin with, and the share that it takes held out."""

    part: LawPart
    coordinates: Array
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LawSpace:
    """Responses of every term at a reference, and the rows of what it leaves."""

    responses: Responses
    rows: FoldRows

    @classmethod
    def at(
        cls,
        evidence: Evidence,
        reference: Reference,
        tau: Array,
        known: Responses | None = None,
        progress: Say = silent,
    ) -> LawSpace:
        """Rows and responses at a reference; `known` responses are taken as they are."""
        plant: PlacesPlant = reference.model.plant  # type: ignore[assignment]
        point = reference.model.point(reference.x)
        made = known or responses(
            plant,
            point,
            evidence.played,
            progress=progress,
            space=candidate_laws(plant, point, evidence.played),
        )
        left = evidence.left(reference.exact)
        beside = opened(evidence, reference, weights(evidence, left, tau))
        z = beside(left[None])[0]
        A = np.zeros((len(made.runs[0]), len(z)), dtype=np.float32)
        # A law at a time: all in double precision would be a gigabyte.
        for span in made.columns:
            raw = [r[span.start : span.stop].astype(np.float64) for r in made.runs]
            A[span.start : span.stop] = beside(evidence.rows(raw))
        return cls(responses=made, rows=FoldRows(z, A, evidence.fold))

    def selected(self) -> list[SelectedLaw]:
        """The best law of each place, the place whose law takes most first."""
        size = max(self.rows.square, 1e-12)
        best: dict[str, tuple[float, SelectedLaw]] = {}
        for candidate in self.responses.candidates():
            chosen = _forward(self.rows, candidate)
            groups = (*(1 + g for g in chosen.chosen), 0)
            columns = candidate.groups[list(groups)].ravel()
            share = chosen.best / size
            worth = share * (_SIMPLER if candidate.groups.shape[1] > 1 else 1.0)
            known = best.get(candidate.place)
            if known is None or worth > known[0]:
                start = fitted(self.rows.products(columns)).mean
                part = LawPart(candidate, columns, self.responses)
                selected = SelectedLaw(part=part, coordinates=start, share=share)
                best[candidate.place] = (worth, selected)
        ordered = sorted(best.values(), key=lambda pair: -pair[0])
        return [law for _, law in ordered]


def _forward(rows: FoldRows, candidate: Candidate) -> Forward:
    """The terms of a candidate that take most; the constant is always in."""
    constant: Index = candidate.groups[0]
    numbers = candidate.groups[1:]
    free = np.unique(numbers)
    groups = len(constant) + np.searchsorted(free, numbers)
    worth = np.asarray(_SIMPLER ** (np.array(candidate.orders[1:]) - 1.0))
    products = rows.products(np.concatenate([constant, free]))
    return forward(products, groups, worth, depth=MOST_TERMS, before=len(constant))
