"""Detection limits: the least strength at which these runs would have shown each effect.

An effect of strength s adds s²·a_c to the mean square of channel c, with the parameters
marginalised. It is detected once that costs a model without it the log prior odds against it.
"""

from collections.abc import Iterable

import numpy as np

from smad.diagnosis.plant import Array, EffectParameter
from smad.diagnosis.rivals.evidence import without_drifts
from smad.diagnosis.rivals.fit import reference_of
from smad.diagnosis.rivals.score import log_scores
from smad.diagnosis.rivals.screening import marginal_variances
from smad.diagnosis.rivals.search import Search
from smad.units import in_words

_RANGE = (1e-6, 1e6)


def unseen_strengths(search: Search) -> list[str]:
    """Each absent effect with its detection limit in words, the largest limit first."""
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
    added_by = marginal_variances(e, reference)
    sizes = [
        _strength(v, added_by(change.rows.astype(np.float64)), of_score, e.least_square)
        for change, _ in absent
    ]
    return limits_in_words((c.effect.name, q, s) for (c, q), s in zip(absent, sizes, strict=True))


def limits_in_words(limits: Iterable[tuple[str, EffectParameter, float]]) -> list[str]:
    """Effect, strength and its limit in typical strengths as words, the largest limit first.

    A change that was replayed twice (a shape may be typical at an end of its range) counts once.
    """
    sizes: dict[str, float] = {}
    for name, q, size in limits:
        strength = size * abs(q.typical)
        # 210, not 2.1e+02.
        below = f"less than {float(f'{strength:.2g}'):g} {in_words(q.unit)}".rstrip()
        words = below if strength < (q.high if q.typical > 0.0 else -q.low) else "any strength"
        sizes[f"{name}, {q.name}: {words}"] = size
    return sorted(sizes, key=lambda text: (sizes[text], text), reverse=True)


def _strength(v: Array, added: Array, needed: float, least_square: float) -> float:
    """The factor s at which the score of v_c + s² a_c is `needed` below that of v_c, (channels,)
    each; infinite where none up to the end of `_RANGE` suffices.
    """
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
