"""Strength and shape of entries by replay: Gauss-Newton in white space from the linear answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.plant import Array, Effect, Mask
from smad.diagnosis.search.space import Space

WhiteEffect = Callable[[Mapping[str, Mapping[str, float]]], Array | None]
"""White rows of what effects change of the reference model; None if it cannot be simulated."""

_DAMPING = (0.0, 0.05, 0.5, 5.0)
_SMALL = 0.5
_SMALL_SHARE = 1e-3


@dataclass(frozen=True)
class Refined:
    """Effects with refined values: what they take of the sum of squares, and the white slopes."""

    effects: tuple[Effect, ...]
    values: dict[str, dict[str, float]]
    gain: float
    change: Array
    slopes: Array
    coordinates: Array
    at_bound: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(e.name for e in self.effects)


def refine(
    effects: Sequence[Effect],
    start: Mapping[str, Mapping[str, float]],
    z: Array,
    white: WhiteEffect,
    rounds: int = 4,
) -> Refined | None:
    """The effects' best values near `start`; None where the model cannot be simulated there."""
    space = Space((), tuple(effects))
    p = space.start(start)
    low, high = space.bounds()
    p = np.clip(p, low, high)
    mean, precision = space.prior()
    change = white(space.point(p).effects)
    if change is None:
        return None

    def cost(q: Array, moved: Array) -> float:
        off = q - mean
        return float((z - moved) @ (z - moved) + off @ precision @ off)

    J = np.zeros((len(p), len(z)))
    now = cost(p, change)
    for _ in range(rounds):
        J = _slopes(space, p, change, white, high)
        left = z - change
        A, g = J @ J.T + precision, J @ left - precision @ (p - mean)
        better = False
        for damping in _DAMPING:
            step = np.linalg.solve(A + damping * np.diag(np.diag(A)), g)
            q = np.clip(p + step, low, high)
            moved = white(space.point(q).effects)
            if moved is None:
                continue
            new = cost(q, moved)
            if new < now:
                gained, p, change, now, better = now - new, q, moved, new, True
                break
        if not better or gained < max(_SMALL, _SMALL_SHARE * (float(z @ z) - now)):
            break
    values = {name: dict(v) for name, v in space.point(p).effects.items()}
    flat = [(e.name, q) for e in effects for q in e.parameters]
    bound = tuple(
        f"{name}.{q.name}"
        for (name, q), x, lo, hi in zip(flat, p, low, high, strict=True)
        if q.strength and (x >= hi - 1e-6 or (q.low < 0.0 and x <= lo + 1e-6))
    )
    gain = float(z @ z - (z - change) @ (z - change))
    return Refined(tuple(effects), values, gain, change, J, p, bound)


def _slopes(space: Space, p: Array, change: Array, white: WhiteEffect, high: Array) -> Array:
    steps = space.steps(p)
    out = np.zeros((len(p), len(change)))
    for i, wide in enumerate(steps):
        q = p.copy()
        step = -wide if q[i] + wide > high[i] else wide
        q[i] += step
        moved = white(space.point(q).effects)
        if moved is not None:
            out[i] = (moved - change) / step
    return out


def without(fit: Refined, z: Array, kept: Mask) -> dict[str, dict[str, float]]:
    """The values that a fit has without some rows: one more step on those that are `kept` (rows,).

    It is taken along the fit's own slopes, within the ranges of the effects.
    """
    if not kept.any():
        return fit.values
    space = Space((), fit.effects)
    low, high = space.bounds()
    J, left = fit.slopes[:, kept], (z - fit.change)[kept]
    _, precision = space.prior()
    step = np.linalg.solve(J @ J.T + precision, J @ left)
    point = space.point(np.clip(fit.coordinates + step, low, high))
    return {name: dict(v) for name, v in point.effects.items()}
