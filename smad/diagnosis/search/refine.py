"""Strength and shape of an effect by replay: Gauss-Newton in white space from the linear answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Effect, EffectValues, Mask

WhiteEffect = Callable[[EffectValues], Array | None]
"""White rows of what effects change of the reference model; None if it cannot be simulated."""

_ROUNDS = 4
_DAMPING = (0.0, 0.05, 0.5, 5.0)
_SMALL = 0.5
_SMALL_SHARE = 1e-3
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
        A, g = J @ J.T + precision, J @ (z - change) - precision @ (p - mean)
        before = now
        for damping in _DAMPING:
            step = np.linalg.solve(A + damping * np.diag(np.diag(A)), g)
            q = np.clip(p + step, low, high)
            moved = changed(q)
            if moved is not None and (new := cost(q, moved)) < now:
                p, change, now = q, moved, new
                break
        if before - now < max(_SMALL, _SMALL_SHARE * (float(z @ z) - now)):
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
