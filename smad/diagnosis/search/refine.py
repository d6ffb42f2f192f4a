"""Strength and shape of an effect by replay: Gauss-Newton in white space from the linear answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Effect, EffectValues, Mask
from smad.diagnosis.search.space import Space

WhiteEffect = Callable[[EffectValues], Array | None]
"""White rows of what effects change of the reference model; None if it cannot be simulated."""

_ROUNDS = 4
_DAMPING = (0.0, 0.05, 0.5, 5.0)
_SMALL = 0.5
_SMALL_SHARE = 1e-3


@dataclass(frozen=True)
class Refined:
    """An effect with refined values: what it takes of the sum of squares, and the white slopes.

    `change` (rows,) are the white rows of what it changes, `slopes` (k, rows) their derivatives by
    its `coordinates` (k,).
    """

    effect: Effect
    gain: float
    change: Array
    slopes: Array
    coordinates: Array

    @property
    def name(self) -> str:
        """The effect's."""
        return self.effect.name

    @property
    def values(self) -> dict[str, float]:
        """Values of its parameters."""
        return Space(self.effect).values(self.coordinates)


def refine(
    effect: Effect, start: Mapping[str, float], z: Array, white: WhiteEffect
) -> Refined | None:
    """The effect's best values near `start`; None where the model cannot be simulated there."""
    space = Space(effect)
    low, high = space.bounds()
    p = np.clip(space.coordinates(start), low, high)
    mean, precision = space.prior()

    def changed(q: Array) -> Array | None:
        return white({effect.name: space.values(q)})

    def cost(q: Array, moved: Array) -> float:
        off = q - mean
        return float((z - moved) @ (z - moved) + off @ precision @ off)

    change = changed(p)
    if change is None:
        return None
    J = np.zeros((len(p), len(z)))
    now = cost(p, change)
    for _ in range(_ROUNDS):
        J = _slopes(space, p, change, changed, high)
        left = z - change
        A, g = J @ J.T + precision, J @ left - precision @ (p - mean)
        better = False
        for damping in _DAMPING:
            step = np.linalg.solve(A + damping * np.diag(np.diag(A)), g)
            q = np.clip(p + step, low, high)
            moved = changed(q)
            if moved is None:
                continue
            new = cost(q, moved)
            if new < now:
                gained, p, change, now, better = now - new, q, moved, new, True
                break
        if not better or gained < max(_SMALL, _SMALL_SHARE * (float(z @ z) - now)):
            break
    gain = float(z @ z - (z - change) @ (z - change))
    return Refined(effect, gain, change, J, p)


def _slopes(
    space: Space, p: Array, change: Array, changed: Callable[[Array], Array | None], high: Array
) -> Array:
    steps = space.steps(p)
    out = np.zeros((len(p), len(change)))
    for i, wide in enumerate(steps):
        q = p.copy()
        step = -wide if q[i] + wide > high[i] else wide
        q[i] += step
        moved = changed(q)
        if moved is not None:
            out[i] = (moved - change) / step
    return out


def without(fit: Refined, z: Array, kept: Mask) -> dict[str, float]:
    """The values that a fit has without some rows: one more step on those that are `kept` (rows,).

    It is taken along the fit's own slopes, within the ranges of the effect.
    """
    if not kept.any():
        return fit.values
    space = Space(fit.effect)
    low, high = space.bounds()
    J, left = fit.slopes[:, kept], (z - fit.change)[kept]
    _, precision = space.prior()
    step = np.linalg.solve(J @ J.T + precision, J @ left)
    return space.values(np.clip(fit.coordinates + step, low, high))
