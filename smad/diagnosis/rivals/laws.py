"""Laws as rivals: for each place the few terms that explain most out of sample.

Terms are selected by their linear responses at a reference, with the parameters marginalised. A law
is then fitted and judged by replay like any other rival.
"""

import numpy as np

from smad.diagnosis.numerics.forward import FoldRows, Forward, fitted, forward
from smad.diagnosis.places.responses import Candidate, Responses
from smad.diagnosis.plant import Array, Index
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference
from smad.diagnosis.rivals.parts import LawPart
from smad.diagnosis.rivals.screening import marginaliser

MOST_TERMS = 3
"""Most terms of a law, so that it can be read."""
_SIMPLER = 0.97
"""Factor on the gain of a term for each further order, and of a law on both sides."""


def selected_laws(
    evidence: Evidence, reference: Reference, responses: Responses
) -> list[tuple[LawPart, Array]]:
    """The best law of each place with its linear coefficients, the one that explains most first.

    `responses` are those of all terms at the reference, or near it.
    """
    residual = evidence.residual(reference.exact)
    marginalised = marginaliser(evidence, reference)
    z = marginalised(residual[None])[0]
    A = np.zeros((len(responses.runs[0]), len(z)), dtype=np.float32)
    # One law at a time: all responses in double precision would be a gigabyte.
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
    """Select the terms of a candidate; the constant is always in."""
    constant: Index = candidate.groups[0]
    numbers = candidate.groups[1:]
    free = np.unique(numbers)
    groups = len(constant) + np.searchsorted(free, numbers)
    worth = np.asarray(_SIMPLER ** (np.array(candidate.orders[1:]) - 1.0))
    products = rows.products(np.concatenate([constant, free]))
    return forward(products, groups, worth, depth=MOST_TERMS, before=len(constant))
