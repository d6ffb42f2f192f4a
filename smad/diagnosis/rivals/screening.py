"""Screening: which effects of the library are worth a fit, by one replay of each strength and sign.

At a reference the change that an effect makes is scaled to take most of the rows that are left,
with the parameters open beside it. A right effect is often hidden where the parameters have moved
to imitate it, so every reference is asked, and the best of each are fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.data.played import finite, predictions
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.numerics.white import Shrink
from smad.diagnosis.plant import Effect, EffectParameter
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference, weights
from smad.diagnosis.rivals.parts import EffectPart

_LEVELS = (0.3, 1.0)
"""Of the typical strength, that an effect is asked at."""
_FURTHEST = 3.0
"""How far a change is scaled beyond the level that it was made at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """An effect at a reference: coordinates to begin with, and what it takes of the rows."""

    part: EffectPart
    reference: Reference
    coordinates: Array
    gain: float


def opened(evidence: Evidence, reference: Reference, left: Array, tau: Array
           ) -> tuple[Array, Array, Shrink]:  # fmt: skip
    """Weights (n,), and weighted rows (n,) beside open parameters, with what opens others alike."""
    weight = weights(evidence, left, tau)
    model = reference.model
    root = np.linalg.cholesky(np.linalg.inv(model.parameter_precision))
    directions = evidence.shrunk(root.T @ reference.slopes, weight)
    shrink = Shrink(directions)
    return weight, shrink(evidence.shrunk(left[None], weight))[0], shrink


def screened(
    evidence: Evidence, reference: Reference, effects: Sequence[Effect], tau: Array
) -> list[Screened]:
    """Effects by what they take of what the reference leaves, the best first."""
    left = evidence.left(reference.exact)
    weight, z, shrink = opened(evidence, reference, left, tau)
    point = reference.model.point(reference.x)
    out: list[Screened] = []
    for effect in effects:
        part = EffectPart(effect)
        strengths = {q.name for q in effect.parameters if q.strength}
        best: Screened | None = None
        for values in _asked(effect):
            at = replace(point, effects={**point.effects, effect.name: values})
            found = predictions(reference.model.plant, at, evidence.played)
            if not finite(found):
                continue
            change = [(f - b)[None] for f, b in zip(found, reference.averaged, strict=True)]
            s = shrink(evidence.shrunk(evidence.rows(change), weight))[0]
            square, along = float(s @ s), float(s @ z)
            if square <= 0.0 or along <= 0.0:
                continue
            scale = min(along / square, _FURTHEST) if strengths else 1.0
            gain = 2.0 * scale * along - scale**2 * square
            if best is None or gain > best.gain:
                scaled = {n: v * scale if n in strengths else v for n, v in values.items()}
                low, high = part.bounds()
                start = np.clip(part.coordinates(scaled), low, high)
                best = Screened(part=part, reference=reference, coordinates=start, gain=gain)
        if best is not None:
            out.append(best)
    return sorted(out, key=lambda s: -s.gain)


def changes_of(
    evidence: Evidence, reference: Reference, effect: Effect, tau: Array
) -> list[tuple[EffectParameter, float, Array]]:
    """What a typical strength of an effect adds to the mean square of each channel, (channels,).

    One for each strength, with its value; the parameters are open beside it.
    """
    left = evidence.left(reference.exact)
    weight, _, shrink = opened(evidence, reference, left, tau)
    point = reference.model.point(reference.x)
    root = np.sqrt(np.where(weight > 0.0, weight, 1.0))
    out = []
    for q in (q for q in effect.parameters if q.strength):
        values = {p.name: 0.0 if p.strength else p.typical for p in effect.parameters}
        at = replace(point, effects={**point.effects, effect.name: {**values, q.name: q.typical}})
        found = predictions(reference.model.plant, at, evidence.played)
        if finite(found):
            change = [(f - b)[None] for f, b in zip(found, reference.averaged, strict=True)]
            s = shrink(evidence.shrunk(evidence.rows(change), weight))[0] / root
            out.append((q, q.typical, evidence.variances(s)))
    return out


def _asked(effect: Effect) -> list[dict[str, float]]:
    """Values that an effect is asked at: each strength alone, at two levels and either sign.

    At its typical strength each shape is asked at the ends of its range, too: an effect of one
    spring alone is often hidden where both are asked. An effect that has no strength is there or
    not.
    """
    rest = {q.name: 0.0 if q.strength else q.typical for q in effect.parameters}
    shapes = [q for q in effect.parameters if not q.strength]
    out = [] if len(shapes) < len(effect.parameters) else [rest]
    out += [{**rest, q.name: end} for q in (shapes if out else ()) for end in (q.low, q.high)]
    for q in (q for q in effect.parameters if q.strength):
        for sign in (1.0, -1.0) if q.low < 0.0 < q.high else (1.0,):
            levels = [sign * level * q.typical for level in _LEVELS]
            out += [{**rest, q.name: v} for v in levels if q.low <= v <= q.high]
            typical = {**rest, q.name: min(max(sign * q.typical, q.low), q.high)}
            out += [{**typical, s.name: end} for s in shapes for end in (s.low, s.high)]
    return out
