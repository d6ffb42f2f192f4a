"""A damped step of least squares within bounds."""

import numpy as np

from smad.diagnosis.plant import Array

RIDGE = 1e-9
"""Share of its diagonal that keeps a matrix invertible; far below the information in data."""
_TINY = 1e-12
"""The same for a coordinate that changes nothing, whose diagonal is 0."""


def bounded_step(A: Array, g: Array, low: Array, high: Array, damping: float = 0.0) -> Array:
    """The step s (k,) that nearly minimises ½ sᵀ(A + damping·diag A)s − gᵀs, with low ≤ s ≤ high.

    Coordinates that would leave their range are fixed at its end, and the others solved again.
    Every round fixes at least one, so there are at most k; none is released, so that a lower step
    may exist where several are fixed.
    """
    damped = A + np.diag((damping + RIDGE) * np.diag(A) + _TINY)
    step, free = np.zeros(len(g)), np.ones(len(g), dtype=bool)
    while free.any():
        rest = g[free] - damped[np.ix_(free, ~free)] @ step[~free]
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], rest)
        out = free & ((step < low) | (step > high))
        if not out.any():
            break
        step = np.clip(step, low, high)
        free &= ~out
    return step
