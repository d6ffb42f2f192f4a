"""Laws as rivals: for each place the few terms that take most of rows they were not fitted to.

Terms are selected on the linear picture at a reference, with the parameters open beside them; what
is selected is then fitted and judged by replay like any other rival.
"""

from __future__ import annotations

import numpy as np

from smad.diagnosis.numerics.forward import FoldRows, Forward, fitted, forward
from smad.diagnosis.places.responses import Candidate, Responses
from smad.diagnosis.plant import Array, Index
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference
from smad.diagnosis.rivals.parts import LawPart
from smad.diagnosis.rivals.screening import marginaliser

MOST_TERMS = 3
"""Terms of a law at most, so that it can be read."""
_SIMPLER = 0.97
"""What a term of one order more is worth, and a law on both springs beside one on either."""


def selected_laws(
    evidence: Evidence, reference: Reference, responses: Responses
) -> list[tuple[LawPart, Array]]:
    """The best law of each place with coefficients to begin with, the one that takes most first.

    `responses` are of every term, at the reference or near it.
    """
    residual = evidence.residual(reference.exact)
    marginalised = marginaliser(evidence, reference)
    z = marginalised(residual[None])[0]
    A = np.zeros((len(responses.runs[0]), len(z)), dtype=np.float32)
    # A law at a time: all in double precision would be a gigabyte.
    for span in responses.columns:
        raw = [r[span.start : span.stop].astype(np.float64) for r in responses.runs]
        A[span.start : span.stop] = marginalised(evidence.rows(raw))
    rows = FoldRows(z, A, evidence.fold)
    best: dict[str, tuple[float, LawPart, Array]] = {}
    for candidate in responses.candidates():
        chosen = _forward(rows, candidate)
        columns = candidate.groups[[*(1 + g for g in chosen.chosen), 0]].ravel()
        worth = chosen.best * (_SIMPLER if candidate.groups.shape[1] > 1 else 1.0)
        if candidate.place not in best or worth > best[candidate.place][0]:
            part = LawPart(candidate, columns, responses)
            best[candidate.place] = worth, part, fitted(rows.products(columns))
    ordered = sorted(best.values(), key=lambda law: -law[0])
    return [(part, start) for _, part, start in ordered]


def _forward(rows: FoldRows, candidate: Candidate) -> Forward:
    """The terms of a candidate that take most; the constant is always in."""
    constant: Index = candidate.groups[0]
    numbers = candidate.groups[1:]
    free = np.unique(numbers)
    groups = len(constant) + np.searchsorted(free, numbers)
    worth = np.asarray(_SIMPLER ** (np.array(candidate.orders[1:]) - 1.0))
    products = rows.products(np.concatenate([constant, free]))
    return forward(products, groups, worth, depth=MOST_TERMS, before=len(constant))
