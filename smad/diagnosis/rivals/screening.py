"""Screening: which effects of the library are worth a fit, by what each of them changes.

At a reference a change is scaled to take most of the rows that are left, with the parameters open
beside it. A right effect is often hidden where the parameters have moved to imitate it, so every
reference is asked, and the best of each are fitted. What an effect changes does not grow evenly
with its values: a fit begins where a replay leaves least. An effect that is there or not is always
fitted: what it changes is not small, and a linear picture of it promises nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.white import Shrink
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.changes import Change
from smad.diagnosis.rivals.evidence import Evidence, weights
from smad.diagnosis.rivals.fit import Reference, replayed
from smad.diagnosis.rivals.parts import EffectPart

_MOST = 8
"""Effects of a reference that are worth a fit. One that acts beyond a limit may promise little: an
overflow of tanks, which left least, a fifth of what another one did."""
_FURTHEST = 3.0
"""How far a change is scaled beyond the level that it was made at."""
_WORTH, _STARTS = 0.5, 4
"""Starts of an effect promise so much of what its best one does, and are so many at most."""
_WEAKER = 0.3
"""Share of the strength that is promised, that a fit may begin with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """An effect at a reference: coordinates that a fit may begin with, the most promising first,
    and what it takes of the rows."""

    part: EffectPart
    starts: tuple[Array, ...]
    gain: float


def marginaliser(evidence: Evidence, reference: Reference) -> Callable[[Array], Array]:
    """What takes rows (m, n) times the root of their weights at the reference, and opens beside
    them whatever that has slopes of, within its prior."""
    weight = weights(evidence, evidence.residual(reference.exact))
    count = len(reference.slopes)
    _, precision = reference.model.prior
    root = np.linalg.cholesky(np.linalg.inv(precision[:count, :count]))
    whitening = evidence.whitening(weight)
    shrink = Shrink(whitening(root.T @ reference.slopes))
    return lambda values: shrink(whitening(values))


def marginal_variances(evidence: Evidence, reference: Reference) -> Callable[[Array], Array]:
    """What gives the mean square of rows (n,) in each channel, in floors, (channels,).

    Whatever the reference has slopes of is open beside them.
    """
    weight = weights(evidence, evidence.residual(reference.exact))
    marginalised, root = (
        marginaliser(evidence, reference),
        np.sqrt(np.where(weight > 0.0, weight, 1.0)),
    )
    return lambda rows: evidence.variances(marginalised(rows[None])[0] / root)


def screen(evidence: Evidence, reference: Reference, changes: Sequence[Change]) -> list[Screened]:
    """Effects by what they take of what the reference leaves, the best first."""
    residual = evidence.residual(reference.exact)
    marginalised = marginaliser(evidence, reference)
    z = marginalised(residual[None])[0]
    promising: dict[str, list[tuple[float, Array]]] = {}
    parts = {change.effect.name: EffectPart(change.effect) for change in changes}
    for change in changes:
        s = marginalised(change.rows[None].astype(np.float64))[0]
        square, along = float(s @ s), float(s @ z)
        effect = change.effect
        strengths = {q.name for q in effect.parameters if q.strength}
        if strengths and (square <= 0.0 or along <= 0.0):
            continue
        scale = min(along / square, _FURTHEST) if strengths else 1.0
        gain = 2.0 * scale * along - scale**2 * square
        scaled = {n: v * scale if n in strengths else v for n, v in change.values.items()}
        start = np.clip(parts[effect.name].coordinates(scaled), *parts[effect.name].bounds())
        promising.setdefault(effect.name, []).append((gain, start))
    out = []
    for name, pairs in promising.items():
        pairs.sort(key=lambda pair: -pair[0])
        best = pairs[0][0]
        # What is there or not may promise less than nothing.
        least = best - (1.0 - _WORTH) * abs(best)
        starts = [start for gain, start in pairs if gain >= least][:_STARTS]
        out.append(Screened(part=parts[name], starts=tuple(starts), gain=best))
    return sorted(out, key=lambda s: -s.gain)


def worth_a_fit(ranked: Sequence[Screened]) -> list[Screened]:
    """Of effects by what they take, those that are fitted."""
    return [s for k, s in enumerate(ranked) if k < _MOST or not s.part.has_strength]


def best_starts(
    evidence: Evidence, reference: Reference, candidates: Sequence[Screened]
) -> list[tuple[EffectPart, Array]]:
    """Effects with the coordinates beside the reference's at which a replay leaves least.

    The starts of each are compared, and a weaker one, with the parameters open beside them.
    """
    variances = marginal_variances(evidence, reference)
    rows = evidence.counts.sum(axis=0)

    def least(part: EffectPart, start: Array) -> float:
        model = reference.model.with_parts([*reference.model.parts, part])
        x = np.concatenate([reference.x, start])
        predicted = replayed(evidence, model.point(x), model, exact=False)
        if predicted is None:
            return np.inf
        residual = evidence.residual(
            [p + s for p, s in zip(predicted, reference.shift, strict=True)]
        )
        return float(rows @ np.log(variances(residual) + 1.0))

    out = []
    for s in candidates:
        starts = (*s.starts, s.part.weaker(s.starts[0], _WEAKER))
        out.append((s.part, min(starts, key=lambda start: least(s.part, start))))
    return out
