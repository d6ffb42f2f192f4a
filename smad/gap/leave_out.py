"""Each run predicted by a model that was fitted to the others only.

The parameters without run k follow from the normal equations of the fit: one step, no new
sensitivities. A refit with many free parameters may be carried far by losing a run, beyond where
the equations hold. The step is therefore replayed on the runs that it is fitted to, and shortened
by damping until it serves them; where none does, the parameters stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.gap.lsq import Fitted, solve_box
from smad.gap.plant import Array, ModelPoint

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
    """The search for the parameters without one run."""

    run: int
    H: Array
    g: Array
    others: Array
    best: float
    p: Array
    predicted: Array


def left_out(fit: Fitted) -> LeftOut:
    """Leaves out each run in turn; a single run keeps the fit's own point."""
    ev = fit.problem.evidence
    searches = _searches(fit) if len(ev.runs) > 1 else []
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
    for segment in ev.segments if searches else ():
        predicted[segment.rows] = searches[segment.run].predicted[segment.rows]
    points = [fit.space.point(s.p) for s in searches] or [fit.point]
    return LeftOut(tuple(points), predicted)


def _searches(fit: Fitted) -> list[_Without]:
    ev = fit.problem.evidence
    H, g = fit.normal_equations()
    _, precision = fit.space.prior()
    out = []
    for run in range(len(ev.runs)):
        others = ev.cell_run != run
        # At the minimum the gradients of all runs and of the prior cancel, so that what is left
        # without this run is its own, reversed. Using that keeps an unfinished fit from counting.
        out.append(
            _Without(
                run,
                H[others].sum(axis=0) + precision,
                -g[~others].sum(axis=0),
                others,
                _loss(fit, others, fit.p, fit.z),
                fit.p,
                fit.predicted,
            )
        )
    return out


def _step(fit: Fitted, s: _Without, damping: float) -> Array:
    lo, hi = fit.space.bounds()
    return solve_box(s.H + damping * np.diag(np.diag(s.H)), s.g, lo - fit.p, hi - fit.p)


def _settled(fit: Fitted, s: _Without, step: Array, predicted: Array) -> bool:
    """Takes a step that serves the other runs; whether the search is at its end."""
    ev = fit.problem.evidence
    if any(ev.failed(predicted, r) for r in range(len(ev.runs))):
        return False
    loss = _loss(fit, s.others, fit.p + step, fit.problem.white(predicted))
    begun = s.p is not fit.p
    if loss >= s.best:
        return begun
    promised = float(s.g @ step - 0.5 * step @ s.H @ step)
    trusted = s.best - loss >= _TRUSTED * promised
    s.best, s.p, s.predicted = loss, fit.p + step, predicted
    return trusted


def _loss(fit: Fitted, cells: Array, p: Array, z: Array) -> float:
    """The objective of a fit to some of the cells."""
    mean, precision = fit.space.prior()
    off = p - mean
    return float(0.5 * off @ precision @ off - fit.problem.cell_score(z)[cells].sum())
