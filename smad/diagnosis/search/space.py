"""The coordinates of an effect's fit: its parameters, scaled and bounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Effect

_STEP, _LEAST_STEP = 0.15, 0.02


@dataclass(frozen=True)
class Space:
    """Coordinates p (k,) of an effect: each of its parameters over its scale."""

    effect: Effect

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of each coordinate."""
        low = [q.low / q.scale for q in self.effect.parameters]
        high = [q.high / q.scale for q in self.effect.parameters]
        return np.array(low), np.array(high)

    def prior(self) -> tuple[Array, Array]:
        """Mean (k,) and precision matrix (k, k) of the normal prior.

        It only keeps a flat direction from wandering: half the range wide, around no strength and
        the typical shape.
        """
        own = self.effect.parameters
        mean = [0.0 if q.strength else float(np.sign(q.typical)) for q in own]
        precision = [(2 * q.scale / (q.high - q.low)) ** 2 + 1e-9 for q in own]
        return np.array(mean), np.diag(precision)

    def steps(self, p: Array) -> Array:
        """Finite-difference steps at `p`; shape (k,).

        Wide, since a hysteretic replay is rough on a small scale; but no wider than half of where
        an effect stands, since a lag of milliseconds in a library that goes to seconds is sharp.
        """
        away = np.abs(p)
        return np.where(away < 1e-9, _STEP, np.clip(0.5 * away, _LEAST_STEP, _STEP))

    def coordinates(self, values: Mapping[str, float]) -> Array:
        """The coordinates of the effect's values."""
        return np.array([values[q.name] / q.scale for q in self.effect.parameters])

    def values(self, p: Array) -> dict[str, float]:
        """The effect's values at coordinates `p`."""
        own = zip(self.effect.parameters, p, strict=True)
        return {q.name: float(x) * q.scale for q, x in own}
