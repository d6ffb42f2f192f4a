"""Screening: which effects of the library are worth a fit, by one replay of each strength and sign.

What an effect changes is asked once, at the nominal simulator. At a reference that change is scaled
to take most of the rows that are left, with the parameters open beside it. A right effect is often
hidden where the parameters have moved to imitate it, so every reference is asked, and the best of
each are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
class Change:
    """What an effect changes with these values, as rows (n,)."""

    effect: Effect
    values: dict[str, float]
    rows: Array

    @property
    def typical(self) -> EffectParameter | None:
        """The strength that is at its typical value, where everything else is usual; else None."""
        acting = [q for q in self.effect.parameters if q.strength and self.values[q.name] != 0.0]
        usual = all(
            self.values[q.name] == q.typical for q in self.effect.parameters if not q.strength
        )
        one = len(acting) == 1 and self.values[acting[0].name] == acting[0].typical
        return acting[0] if one and usual else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """An effect at a reference: coordinates to begin with, and what it takes of the rows."""

    part: EffectPart
    reference: Reference
    coordinates: Array
    gain: float


def changes_at(
    evidence: Evidence, reference: Reference, effects: Sequence[Effect]
) -> tuple[Change, ...]:
    """What each effect changes there, at each of the values that it is asked at."""
    plant, point = reference.model.plant, reference.model.point(reference.x)
    base = predictions(plant, point, evidence.coarse)
    out: list[Change] = []
    for effect in effects:
        for values in _values(effect):
            at = replace(point, effects={**point.effects, effect.name: values})
            predicted = predictions(plant, at, evidence.coarse)
            if finite(predicted):
                change = [(f - b)[None] for f, b in zip(predicted, base, strict=True)]
                rows = evidence.rows(change)[0].astype(np.float32)
                out.append(Change(effect=effect, values=values, rows=rows))
    return tuple(out)


def opened(evidence: Evidence, reference: Reference, weight: Array) -> Callable[[Array], Array]:
    """What takes rows (m, n) times the root of their weights, and opens beside them whatever the
    reference has slopes of, within its prior."""
    known = len(reference.slopes)
    _, precision = reference.model.prior
    root = np.linalg.cholesky(np.linalg.inv(precision[:known, :known]))
    weighted = evidence.weighted(weight)
    shrink = Shrink(weighted(root.T @ reference.slopes))
    return lambda values: shrink(weighted(values))


def screened(
    evidence: Evidence, reference: Reference, changes: Sequence[Change], tau: Array
) -> list[Screened]:
    """Effects by what they take of what the reference leaves, the best first."""
    left = evidence.left(reference.exact)
    beside = opened(evidence, reference, weights(evidence, left, tau))
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
        best[effect.name] = Screened(part=part, reference=reference, coordinates=start, gain=gain)
    return sorted(best.values(), key=lambda s: -s.gain)


def added_squares(
    evidence: Evidence, reference: Reference, changes: Sequence[Change], tau: Array
) -> list[Array]:
    """What changes add to the mean square of each channel, (channels,), beside open parameters."""
    weight = weights(evidence, evidence.left(reference.exact), tau)
    beside = opened(evidence, reference, weight)
    root = np.sqrt(np.where(weight > 0.0, weight, 1.0))
    return [evidence.variances(beside(c.rows[None].astype(np.float64))[0] / root) for c in changes]


def _values(effect: Effect) -> list[dict[str, float]]:
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
