"""Screening: which effects of the library are worth a fit, by what each of them changes.

At a reference a change is scaled to take most of the rows that are left, with the parameters open
beside it. A right effect is often hidden where the parameters have moved to imitate it, so every
reference is asked, and the best of each are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.white import Shrink
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.changes import Change
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference, weights
from smad.diagnosis.rivals.parts import EffectPart

_FURTHEST = 3.0
"""How far a change is scaled beyond the level that it was made at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """An effect at a reference: coordinates to begin with, and what it takes of the rows."""

    part: EffectPart
    coordinates: Array
    gain: float


def opened(evidence: Evidence, reference: Reference, weight: Array) -> Callable[[Array], Array]:
    """What takes rows (m, n) times the root of their weights, and opens beside them whatever the
    reference has slopes of, within its prior."""
    known = len(reference.slopes)
    _, precision = reference.model.prior
    root = np.linalg.cholesky(np.linalg.inv(precision[:known, :known]))
    weighted = evidence.weighted(weight)
    shrink = Shrink(weighted(root.T @ reference.slopes))
    return lambda values: shrink(weighted(values))


def screened(evidence: Evidence, reference: Reference, changes: Sequence[Change]) -> list[Screened]:
    """Effects by what they take of what the reference leaves, the best first."""
    left = evidence.left(reference.exact)
    beside = opened(evidence, reference, weights(evidence, left))
    z = beside(left[None])[0]
    best: dict[str, Screened] = {}
    for change in changes:
        s = beside(change.rows[None].astype(np.float64))[0]
        square, along = float(s @ s), float(s @ z)
        if square <= 0.0 or along <= 0.0:
            continue
        effect = change.effect
        strengths = {q.name for q in effect.parameters if q.strength}
        scale = min(along / square, _FURTHEST) if strengths else 1.0
        gain = 2.0 * scale * along - scale**2 * square
        if effect.name in best and gain <= best[effect.name].gain:
            continue
        part = EffectPart(effect)
        scaled = {n: v * scale if n in strengths else v for n, v in change.values.items()}
        start = np.clip(part.coordinates(scaled), *part.bounds())
        best[effect.name] = Screened(part=part, coordinates=start, gain=gain)
    return sorted(best.values(), key=lambda s: -s.gain)


def added_squares(
    evidence: Evidence, reference: Reference, changes: Sequence[Change]
) -> list[Array]:
    """What changes add to the mean square of each channel, (channels,), beside open parameters."""
    weight = weights(evidence, evidence.left(reference.exact))
    beside = opened(evidence, reference, weight)
    root = np.sqrt(np.where(weight > 0.0, weight, 1.0))
    return [evidence.variances(beside(c.rows[None].astype(np.float64))[0] / root) for c in changes]
