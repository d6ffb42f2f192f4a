"""Resamples of what was judged, in blocks of time of each run."""

from __future__ import annotations

import numpy as np

from smad.gap.data.replay import Index
from smad.gap.plant import Array

DRAWS = 400
"""Resamples behind an interval or a probability."""


def block_of(cell_run: Index, cell_block: Index) -> Index:
    """Number of the block of time of one run that each cell lies in; shape (cells,)."""
    cells = np.column_stack([cell_run, cell_block])
    return np.asarray(np.unique(cells, axis=0, return_inverse=True)[1].ravel(), dtype=np.intp)


def resample_weights(
    cell_run: Index, cell_block: Index, draws: int, rng: np.random.Generator
) -> Array:
    """Bootstrap counts over runs and blocks; shape (draws, cells).

    Cells of one run and block move together, since their errors share causes. Bayesian weights (one
    exponential per block times one per run) avoid draws that lose every block of a regime.
    """
    key = block_of(cell_run, cell_block)
    runs = np.unique(cell_run, return_inverse=True)[1].ravel()
    block = rng.exponential(size=(draws, key.max() + 1))
    # Few runs make a plain run-level weight wild; a gamma of shape 4 keeps the spread of a run's
    # share to a half.
    run = rng.gamma(4.0, 0.25, size=(draws, runs.max() + 1))
    weight = block[:, key] * run[:, runs]
    return np.asarray(weight / weight.mean(axis=1, keepdims=True))
