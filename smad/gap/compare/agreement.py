"""Whether the runs to fit agree with each other, or look as if they were of two benches."""

from __future__ import annotations

import numpy as np

from smad.gap.fit.lsq import FitResult, solve_box
from smad.gap.plant import Array, Mask

DISAGREEING = 3.0
"""Nats a cell from which runs are said to disagree."""


def disagreement(fit: FitResult) -> str:
    """A sentence on runs that ask for other parameters than the others do; "" if none does."""
    gains = own_gains(fit)
    if len(gains) < 2 or float(np.mean(gains)) < DISAGREEING:
        return ""
    names = [run.name for run in fit.problem.dataset.runs]
    apart = [name for name, gain in zip(names, gains, strict=True) if gain > DISAGREEING]
    verb = "asks" if len(apart) == 1 else "ask"
    return (
        f"{', '.join(apart)} {verb} for other parameters than the other runs do: half of a run "
        "predicts its other half better than a model fitted to all runs describes it. Are they of "
        "two benches, or was the bench changed between them? Then ask for each group of runs alone:"
        " what is said here holds for neither."
    )


def own_gains(fit: FitResult) -> list[float]:
    """For each run to fit, by how much its own halves predict each other better than the fit does.

    Nats a cell. Each half is predicted by the parameters that the other half asks for, one step of
    the normal equations from the fit to all runs. That fit has seen what it is compared on, and the
    halves have not: only runs that one set of values cannot serve come out above 0.
    """
    ev = fit.problem.dataset
    together = fit.problem.cell_score(fit.z)
    z = own_halves(fit)
    by_own = fit.problem.cell_score(z)
    return [float(np.mean((by_own - together)[ev.cell_run == k])) for k in range(len(ev.runs))]


def own_halves(fit: FitResult) -> Array:
    """White residuals of each half of a run as its other half predicts it; shape (rows,)."""
    ev = fit.problem.dataset
    z = np.array(fit.z, dtype=float)
    for k in range(len(ev.runs)):
        rows = np.zeros(ev.n, dtype=bool)
        for s in ev.segments:
            rows[s.rows] |= s.run == k
        middle = float(np.median(ev.t_s[rows]))
        early, late = rows & (ev.t_s < middle), rows & (ev.t_s >= middle)
        for asked, predicted in ((early, late), (late, early)):
            z[predicted] = fit.z[predicted] - fit.A[predicted] @ step_of(fit, asked)
    return z


def step_of(fit: FitResult, rows: Mask) -> Array:
    """From the fit to what some rows alone ask for, one step; shape (coordinates,)."""
    lo, hi = fit.space.bounds()
    mean, precision = fit.space.prior()
    weighted = fit.A[rows] * fit.problem.row_weight(fit.z)[rows, None]
    H = (fit.A[rows].T @ weighted).astype(float) + precision
    g = (weighted.T @ fit.z[rows]).astype(float) - precision @ (fit.p - mean)
    return solve_box(H, g, lo - fit.p, hi - fit.p)
