"""Changes: how each effect of the library changes the readings, by replays at a few strengths.

They are computed once at a reference point; those of a baseline are stored with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.data.played import Played, finite, predictions
from smad.diagnosis.plant import Array, Effect, EffectParameter, ModelPoint, PlantModel, Singles
from smad.diagnosis.rivals.evidence import Evidence

_LEVELS = (0.3, 1.0)
"""Shares of the typical strength at which an effect is replayed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Change:
    """The change of the readings by an effect with these values, as rows (n,)."""

    effect: Effect
    values: dict[str, float]
    rows: Array

    @property
    def shape(self) -> tuple[float, ...]:
        """The values of its shapes."""
        return tuple(self.values[q.name] for q in self.effect.parameters if not q.strength)

    @property
    def alone(self) -> EffectParameter | None:
        """The strength that acts at its typical value without the others, else None."""
        acting = [q for q in self.effect.parameters if q.strength and self.values[q.name] != 0.0]
        typical = len(acting) == 1 and self.values[acting[0].name] == acting[0].typical
        return acting[0] if typical else None

    @property
    def typical(self) -> EffectParameter | None:
        """The one strength that acts if it and all shapes are at typical values, else None."""
        usual = tuple(q.typical for q in self.effect.parameters if not q.strength)
        return self.alone if self.shape == usual else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Changes:
    """The changes by `effects`: one array (values, bins, channels) for each run, in the order of
    `values_asked`."""

    effects: tuple[Effect, ...]
    runs: tuple[Singles, ...]

    def rows(self, evidence: Evidence, effects: Sequence[Effect]) -> tuple[Change, ...]:
        """The changes by some effects as rows of evidence of the same runs."""
        names, asked = {effect.name for effect in effects}, values_asked(self.effects)
        used = [k for k, (effect, _) in enumerate(asked) if effect.name in names]
        rows = evidence.rows([run[used].astype(np.float64) for run in self.runs]).astype(np.float32)
        pairs = zip((asked[k] for k in used), rows, strict=True)
        return tuple(Change(effect=e, values=values, rows=r) for (e, values), r in pairs)


def values_asked(effects: Sequence[Effect]) -> tuple[tuple[Effect, dict[str, float]], ...]:
    """The values at which each effect is replayed; none for an effect without parameters."""
    return tuple((e, values) for e in effects if e.parameters for values in _values(e))


def changes_at(
    plant: PlantModel, point: ModelPoint, runs: Sequence[Played], effects: Sequence[Effect]
) -> Changes:
    """Changes by effects at `point`, from coarse replays; 0 where the model fails."""
    coarse = [run.coarse for run in runs]
    base = predictions(plant, point, coarse)
    effect_values = values_asked(effects)
    out = [np.zeros((len(effect_values), *b.shape), dtype=np.float32) for b in base]
    for k, (effect, values) in enumerate(effect_values):
        with_effect = ModelPoint(point.theta, {**point.effects, effect.name: values}, point.laws)
        predicted = predictions(plant, with_effect, coarse)
        if finite(predicted):
            for run, moved, without in zip(out, predicted, base, strict=True):
                run[k] = moved - without
    return Changes(effects=tuple(effects), runs=tuple(out))


def _values(effect: Effect) -> list[dict[str, float]]:
    """Values at which an effect is replayed: each strength alone, at two levels and either sign.

    At the typical strength each shape is also replayed at the ends of its range: an effect on one
    spring alone may not show in a replay of both. An effect without a strength is replayed on.
    """
    rest = {q.name: 0.0 if q.strength else q.typical for q in effect.parameters}
    shapes = [q for q in effect.parameters if not q.strength]
    ends = [(q.name, end) for q in shapes for end in (q.low, q.high) if end != q.typical]
    out = []
    if len(shapes) == len(effect.parameters):
        out = [rest, *({**rest, name: end} for name, end in ends)]
    for q in (q for q in effect.parameters if q.strength):
        for sign in (1.0, -1.0) if q.low < 0.0 < q.high else (1.0,):
            levels = [sign * level * q.typical for level in _LEVELS]
            out += [{**rest, q.name: v} for v in levels if q.low <= v <= q.high]
            typical = {**rest, q.name: min(max(sign * q.typical, q.low), q.high)}
            out += [{**typical, name: end} for name, end in ends]
    return out
