"""What these runs would not have shown: the strength from which an effect would be told.

An effect of strength s adds s²·a_c to the mean square of channel c, with the parameters open beside
it. It would be told once that costs a model without it as much of the score as the effect's prior.
"""

from __future__ import annotations

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.evidence import without_drifts
from smad.diagnosis.rivals.fit import reference_of
from smad.diagnosis.rivals.score import log_scores
from smad.diagnosis.rivals.screening import marginal_variances
from smad.diagnosis.rivals.search import Search
from smad.units import in_words

_RANGE = (1e-6, 1e6)


def unseen_strengths(search: Search) -> list[str]:
    """Each effect with the strength that would have been told, those least seen first."""
    question, fit = search.question, search.final.fit
    e = question.evidence
    reference = search.nominal if fit is None else reference_of(e, fit)
    if reference is None:
        return []
    present = {part.name for part in reference.model.parts}
    v = e.variances(without_drifts(e, e.residual(reference.exact)))
    runs = len(question.judged.trials)
    needed = question.constants.nothing - question.constants.each_effect(len(question.effects))
    of_score = 2.0 * needed / (question.independent_rows * runs)
    absent = [(c, q) for c in search.changes if c.effect.name not in present and (q := c.typical)]
    rows: list[tuple[float, str]] = []
    added_by = marginal_variances(e, reference)
    for change, q in absent:
        added = added_by(change.rows.astype(np.float64))
        size = _strength(v, added, of_score, e.least_square)
        strength = size * abs(q.typical)
        below = f"less than {strength:.2g} {in_words(q.unit)}".rstrip()
        words = below if strength < q.high else "any strength"
        rows.append((strength / abs(q.typical), f"{change.effect.name}, {q.name}: {words}"))
    return [text for _, text in sorted(rows, reverse=True)]


def _strength(v: Array, added: Array, needed: float, least_square: float) -> float:
    """How many times a change is needed, s, for v_c + s² a_c to cost `needed` of the score of v."""

    from scipy.optimize import brentq

    once = np.ones((1, len(v)))

    def short(log_s: float) -> float:
        both = v + np.exp(2.0 * log_s) * added
        of_v, of_both = (log_scores(x[None], once, least_square)[0] for x in (v, both))
        return float(of_v - of_both) - max(needed, 1e-3)

    low, high = np.log(_RANGE[0]), np.log(_RANGE[1])
    if short(high) < 0.0:
        return np.inf
    return float(np.exp(brentq(short, low, high)))
