"""Each run predicted by a model that was fitted to the others only.

The parameters without run k follow from the normal equations of the fit: one step, no new
sensitivities. A refit with many free parameters may be carried far by losing a run, beyond where
the equations hold. The step is therefore replayed on the runs that it is fitted to, and shortened
by damping until it serves them; where none does, the parameters stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.gap.fit.lsq import FitResult, objective, solve_box
from smad.gap.plant import Array, Mask, ModelPoint

_DAMPINGS = (0.0, 0.03, 0.3, 3.0)
_TRUSTED = 0.25


@dataclass(frozen=True)
class LeftOut:
    """For each run of a fit, the model point that the others give, and its prediction of the run.

    `predicted` has the rows of all runs, each as predicted without itself.
    """

    points: tuple[ModelPoint, ...]
    predicted: Array


@dataclass
class _Without:
    """The search for the parameters without one run: the equations and cells of the others.

    `best` is their objective at `p`, the best point so far, which predicts `predicted`.
    """

    H: Array
    g: Array
    others: Mask
    best: float
    p: Array
    predicted: Array


def left_out(fit: FitResult) -> LeftOut:
    """Leaves out each run in turn; a single run keeps the fit's own point."""
    ev = fit.problem.dataset
    if len(ev.runs) == 1:
        return LeftOut((fit.point,), fit.predicted)
    searches = _searches(fit)
    searching = searches
    for damping in _DAMPINGS:
        steps = [_step(fit, s, damping) for s in searching]
        values = ev.predict([fit.space.point(fit.p + step) for step in steps])
        searching = [
            s
            for s, step, value in zip(searching, steps, values, strict=True)
            if not _settled(fit, s, step, value)
        ]
        if not searching:
            break
    predicted = fit.predicted.copy()
    for segment in ev.segments:
        predicted[segment.rows] = searches[segment.run].predicted[segment.rows]
    return LeftOut(tuple(fit.space.point(s.p) for s in searches), predicted)


def _searches(fit: FitResult) -> list[_Without]:
    ev = fit.problem.dataset
    H, g = fit.normal_equations()
    _, precision = fit.space.prior()
    out = []
    for run in range(len(ev.runs)):
        others = ev.cell_run != run
        # At the minimum the gradients of all runs and of the prior cancel, so that what is left
        # without this run is its own, reversed. Using that keeps an unfinished fit from counting.
        out.append(
            _Without(
                H[others].sum(axis=0) + precision,
                -g[~others].sum(axis=0),
                others,
                objective(fit.problem, fit.space, fit.p, fit.z, cells=others),
                fit.p,
                fit.predicted,
            )
        )
    return out


def _step(fit: FitResult, s: _Without, damping: float) -> Array:
    lo, hi = fit.space.bounds()
    return solve_box(s.H + damping * np.diag(np.diag(s.H)), s.g, lo - fit.p, hi - fit.p)


def _settled(fit: FitResult, s: _Without, step: Array, predicted: Array) -> bool:
    """Takes a step that serves the other runs; whether the search is at its end."""
    ev = fit.problem.dataset
    if any(ev.failed(predicted, r) for r in range(len(ev.runs))):
        return False
    z = fit.problem.white(predicted)
    loss = objective(fit.problem, fit.space, fit.p + step, z, cells=s.others)
    begun = s.p is not fit.p
    if loss >= s.best:
        return begun
    promised = float(s.g @ step - 0.5 * step @ s.H @ step)
    trusted = s.best - loss >= _TRUSTED * promised
    s.best, s.p, s.predicted = loss, fit.p + step, predicted
    return trusted
