"""How often chance alone would look like this: bootstrap null and p-values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from smad.gap.data.replay import Index
from smad.gap.fit.lsq import Problem
from smad.gap.fit.screen import Probes, project
from smad.gap.plant import Array

DRAWS = 400
"""Resamples behind an interval or a probability."""


def resampled(problem: Problem, source: Problem, z: Array, rng: np.random.Generator) -> Array:
    """White residuals of `source`, moved block by block into the rows of `problem`.

    Blocks start anywhere in a stretch of the same output, and keep their order inside; each run of
    `problem` is filled with blocks drawn from all runs of `source`.
    """
    ev, pool = problem.evidence, source.evidence
    length = max(2, round(ev.settings.block_s / ev.settings.period_s))
    out = np.zeros(ev.n)
    stretches = {k: [z[s.rows] for s in pool.rows_of(k)] for k in ev.keys}
    for seg in ev.segments:
        own = stretches.get(seg.key) or [rng.standard_normal(length)]
        need, parts = seg.stop - seg.start, []
        while need > 0:
            y = own[int(rng.integers(len(own)))]
            size = min(length, len(y))
            at = int(rng.integers(len(y) - size + 1))
            parts.append(y[at : at + size] * (1.0 if rng.random() < 0.5 else -1.0))
            need -= size
        out[seg.rows] = np.concatenate(parts)[: seg.stop - seg.start]
    return np.where(ev.valid, out, 0.0)


def null_gains(
    probes: Probes, source: Problem, z: Array, draws: int, seed: int
) -> dict[str, Array]:
    """Gain of every effect on data without any effect; shape (draws,) by effect name.

    The whole screening is repeated on each draw. The largest gain over effects, draw by draw, is
    the null of the selection.
    """
    rng = np.random.default_rng(seed)
    problem = probes.fit.problem
    names = [p.effect.name for p in probes.probes]
    low = np.array([p.min_amplitude for p in probes.probes])
    high = np.array([p.max_amplitude for p in probes.probes])
    out: dict[str, list[float]] = {name: [] for name in dict.fromkeys(names)}
    for _ in range(draws):
        drawn = resampled(problem, source, z, rng)
        pr = project(probes, drawn, problem.cell_weight(drawn), at_rest=True)
        a = np.clip(pr.b / pr.d, low, high)
        gain = np.maximum(a * pr.b - 0.5 * a * a * pr.d, 0.0)
        best: dict[str, float] = dict.fromkeys(out, 0.0)
        for name, value in zip(names, gain, strict=True):
            best[name] = max(best[name], float(value))
        for name, value in best.items():
            out[name].append(value)
    return {name: np.array(v) for name, v in out.items()}


def tail_p(observed: float, null: Array) -> float:
    """Share of the null at or above `observed`, continued by an exponential tail beyond it.

    The tail is fitted to the upper quarter of the null, so that p below 1/draws is an extrapolation
    and is never less than 1e-6.
    """
    if len(null) == 0:
        return 1.0
    share = (1 + float(np.sum(null >= observed))) / (1 + len(null))
    if share > 4 / len(null):
        return share
    threshold = float(np.quantile(null, 0.75))
    above = null[null > threshold] - threshold
    scale = float(above.mean()) if len(above) else 1e-9
    return float(max(1e-6, min(share, 0.25 * np.exp(-(observed - threshold) / max(scale, 1e-9)))))


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


def top_null(null: Mapping[str, Array]) -> Array:
    """Largest gain over effects, draw by draw; empty where there is no effect."""
    return np.asarray(np.max(list(null.values()), axis=0)) if null else np.zeros(0)
