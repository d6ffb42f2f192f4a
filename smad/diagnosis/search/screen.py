"""The best linear fit of an effect in white space: its signatures at bounded strength."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, product

import numpy as np
from scipy.optimize import lsq_linear

from smad.diagnosis.data.played import Atom
from smad.diagnosis.plant import Array, Effect

_FURTHEST = 2.5
"""How far a signature is scaled beyond the level that it was made at."""
_RIDGE = 1e-9


@dataclass(frozen=True)
class Screened:
    """The best linear fit of an effect: values of its parameters, and what it takes."""

    effect: Effect
    values: dict[str, float]
    gain: float


def screen(effect: Effect, atoms: Sequence[Atom], G: Array, b: Array) -> Screened | None:
    """The best combination of an effect's signatures, one a strength, all of one variant and size.

    G (atoms, atoms) and b (atoms,) are products of all `atoms`. None where nothing takes anything.
    """
    own = [(i, a) for i, a in enumerate(atoms) if a.entry == effect.name]
    found: list[Screened] = []
    alike = sorted(own, key=lambda one: (one[1].variant, abs(one[1].level)))
    for _, group in groupby(alike, key=lambda one: (one[1].variant, abs(one[1].level))):
        by_strength: dict[str, list[tuple[int, Atom]]] = {}
        for one in group:
            by_strength.setdefault(one[1].strength, []).append(one)
        found += [_combined(effect, choice, G, b) for choice in product(*by_strength.values())]
    best = max(found, key=lambda s: s.gain, default=None)
    return best if best is not None and best.gain > 0.0 else None


def _combined(effect: Effect, choice: Sequence[tuple[int, Atom]], G: Array, b: Array) -> Screened:
    """One signature of each strength, from nothing on to what its parameter's range allows."""
    at = [i for i, _ in choice]
    ranges = {q.name: q for q in effect.parameters}
    high = []
    for _, atom in choice:
        q, value = ranges[atom.strength], atom.values[atom.strength]
        high.append(min(_FURTHEST, (q.high if value > 0 else q.low) / value))
    x = _bounded(G[np.ix_(at, at)], b[at], np.array(high))
    values = dict(choice[0][1].values)
    for scale, (_, atom) in zip(x, choice, strict=True):
        values[atom.strength] = float(scale * atom.values[atom.strength])
    return Screened(effect, values, float(2.0 * b[at] @ x - x @ G[np.ix_(at, at)] @ x))


def _bounded(G: Array, b: Array, high: Array) -> Array:
    """The least of xᵀGx − 2bᵀx for 0 ≤ x ≤ high."""
    ridge = G + (_RIDGE * np.trace(G) + 1e-12) * np.eye(len(b))
    if len(b) == 1:
        return np.asarray(np.clip(b / ridge[0], 0.0, high))
    root = np.linalg.cholesky(ridge)
    return np.asarray(lsq_linear(root.T, np.linalg.solve(root, b), (0.0, high), method="bvls").x)
