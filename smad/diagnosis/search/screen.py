"""Least squares in white space: entries at bounded strength, alone, in sets, refined by replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from smad.diagnosis.plant import Array, Effect

_MOST_COLUMNS = 4


@dataclass(frozen=True)
class Bounded:
    """A bounded least-squares fit: coefficients and what it takes off the sum of squares."""

    coefficients: Array
    gain: float


def bounded(G: Array, b: Array, low: Array, high: Array) -> Bounded:
    """Minimises xᵀGx − 2bᵀx for low ≤ x ≤ high by trying which bounds hold (few columns only)."""
    k = len(b)
    if k > _MOST_COLUMNS:
        return _projected(G, b, low, high)
    ridge = G + 1e-9 * np.trace(G) / max(k, 1) * np.eye(k) + 1e-12 * np.eye(k)
    best = Bounded(np.clip(np.zeros(k), low, high), 0.0)
    for state in product((0, -1, 1), repeat=k):
        held = np.array(state)
        x = np.where(held < 0, low, np.where(held > 0, high, 0.0))
        free = held == 0
        if free.any():
            rest = b[free] - G[np.ix_(free, ~free)] @ x[~free]
            x[free] = np.linalg.solve(ridge[np.ix_(free, free)], rest)
        if np.all(x >= low - 1e-9) and np.all(x <= high + 1e-9):
            gain = float(2.0 * b @ x - x @ G @ x)
            if gain > best.gain:
                best = Bounded(np.clip(x, low, high), gain)
    return best


def _projected(G: Array, b: Array, low: Array, high: Array) -> Bounded:
    """Coordinate descent, for more columns than there is time to enumerate."""
    x = np.clip(np.zeros(len(b)), low, high)
    for _ in range(200):
        for i in range(len(b)):
            if G[i, i] > 1e-12:
                x[i] = np.clip(x[i] + (b[i] - G[i] @ x) / G[i, i], low[i], high[i])
    return Bounded(x, float(2.0 * b @ x - x @ G @ x))


@dataclass(frozen=True)
class Screened:
    """The best linear fit of one entry: values of its parameters, and what it takes."""

    effect: Effect
    values: dict[str, float]
    gain: float
    columns: tuple[int, ...]


def screen(
    effect: Effect,
    rows: Sequence[tuple[int, str, float, str, dict[str, float]]],
    G: Array,
    b: Array,
) -> Screened | None:
    """The best combination of an entry's signatures, one a strength, all of one variant and size.

    `rows` are (index, strength, level, variant, values) of the entry's atoms. A coefficient scales
    its signature by up to a factor of two either way of the level it was made at, from nothing on.
    """
    best: Screened | None = None
    for variant, size in sorted({(v, abs(level)) for _, _, level, v, _ in rows}):
        group = [r for r in rows if r[3] == variant and abs(r[2]) == size]
        by_strength: dict[str, list[tuple[int, str, float, str, dict[str, float]]]] = {}
        for r in group:
            by_strength.setdefault(r[1], []).append(r)
        for choice in product(*by_strength.values()):
            found = _combined(effect, choice, G, b)
            if found is not None and (best is None or found.gain > best.gain):
                best = found
    return best


def _combined(
    effect: Effect,
    choice: Sequence[tuple[int, str, float, str, dict[str, float]]],
    G: Array,
    b: Array,
) -> Screened | None:
    index = np.array([r[0] for r in choice])
    low, high = np.zeros(len(choice)), np.full(len(choice), 1.0)
    ranges = {q.name: q for q in effect.parameters}
    for i, (_, strength, _, _, values) in enumerate(choice):
        q, value = ranges[strength], values[strength]
        edge = q.high if value > 0 else q.low
        high[i] = min(2.5, edge / value)
    fit = bounded(G[np.ix_(index, index)], b[index], low, high)
    if fit.gain <= 0.0:
        return None
    values = dict(choice[0][4])
    for x, (_, strength, _, _, own) in zip(fit.coefficients, choice, strict=True):
        values[strength] = float(x * own[strength])
    return Screened(effect, values, fit.gain, tuple(int(i) for i in index))
