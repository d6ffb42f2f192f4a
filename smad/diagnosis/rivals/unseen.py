"""What these runs would not have shown: the strength from which an effect would be told.

An effect of strength s adds s²·a_c to the mean square of channel c, with the parameters open beside
it. It would be told once that costs a model without it as much of the score as the effect's prior.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.rivals.fit import rebased, reference_at
from smad.diagnosis.rivals.screening import changes_of
from smad.diagnosis.rivals.search import Question, Rival

_RANGE = (1e-6, 1e6)


def unseen_strengths(question: Question, final: Rival) -> list[str]:
    """Each effect with the strength that would have been told, those least seen first."""
    e, fit = question.evidence, final.fit
    zero = np.zeros(question.model.parameters)
    here = reference_at(e, question.model, zero) if fit is None else rebased(e, fit)
    if here is None:
        return []
    present = {part.name for part in here.model.parts}
    v = e.variances(e.left(here.exact))
    runs = len(question.judged.trials)
    needed = question.temper.nothing - question.temper.effect + np.log(len(question.effects) or 1)
    rows: list[tuple[float, str]] = []
    for effect in (x for x in question.effects if x.name not in present):
        for q, value, added in changes_of(e, here, effect, question.tau):
            size = _strength(v, added, 2.0 * needed / (question.temper.evidence * runs))
            unit = "" if q.unit == "1" else f" {q.unit}"
            strength = size * abs(value)
            words = f"less than {strength:.2g}{unit}" if strength < q.high else "any strength"
            rows.append((strength / abs(q.typical), f"{effect.name}, {q.name}: {words}"))
    return [text for _, text in sorted(rows, reverse=True)]


def _strength(v: Array, added: Array, needed: float) -> float:
    """How many times a change is needed for Σ_c log(1 + s² a_c/(v_c + 1)) to reach `needed`."""

    def short(log_s: float) -> float:
        return float(np.log1p(np.exp(2.0 * log_s) * added / (v + 1.0)).sum()) - max(needed, 1e-3)

    low, high = np.log(_RANGE[0]), np.log(_RANGE[1])
    if short(high) < 0.0:
        return np.inf
    return float(np.exp(brentq(short, low, high)))
