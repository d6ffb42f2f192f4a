"""Which runs to fit contradict the rest: one set of values cannot serve all of them.

A cause that only some runs have is hidden in the model without it, which describes none of them,
and in the model with it, whose one strength is right for none. So the runs are judged under every
single cause that was fitted, each with values of its own: half of a run predicts its other half.
The model by which runs predict themselves best says whether one set of values would have done.
Everything is one step of normal equations that the fits have left: nothing is replayed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.gap.data.replay import Dataset
from smad.gap.fit.judge import excess_of
from smad.gap.fit.lsq import FitResult, solve_box
from smad.gap.plant import Array, Mask
from smad.gap.records import RunAgreement


def agreement_of(fits: Sequence[FitResult], answer: FitResult, raw: Array) -> list[RunAgreement]:
    """A record for each run of the fits, which are of the same runs.

    `answer` is the fit that would answer for all runs, one of `fits` or better; `raw` the
    prediction of the model as it was before, shape (rows,), for the gap of each run.
    """
    judged = [_Model.of(fit) for fit in fits]
    best = max(judged, key=lambda m: float(m.own.sum()))
    problem = answer.problem
    ev = problem.dataset
    pooled = problem.cell_score(answer.z)
    best = best.or_as_it_was(problem.cell_score(problem.white(raw)))
    gained = best.own - pooled
    count = len(ev.runs)
    gains = [float(np.mean(gained[ev.cell_run == k])) for k in range(count)]
    apart = set[int]()
    if (
        count > 1
        and float(gained.sum()) > 0.0
        and any(_disagrees(ev, gained, k) for k in range(count))
    ):
        apart = best.apart()
    squares = np.square(problem.scaled(raw))
    return [
        RunAgreement(
            run=run.name,
            gap=excess_of(problem, squares, None, run_rows(ev, k).astype(float)),
            own_gain=gains[k],
            contradicts=k in apart,
        )
        for k, run in enumerate(ev.runs)
    ]


def run_rows(ev: Dataset, run: int) -> Mask:
    """The rows of one run; shape (rows,)."""
    rows = np.zeros(ev.n, dtype=bool)
    for s in ev.segments:
        rows[s.rows] |= s.run == run
    return rows


@dataclass(frozen=True)
class _Model:
    """A fit, and the score of each cell as the other half of its own run predicts it."""

    fit: FitResult
    own: Array

    @classmethod
    def of(cls, fit: FitResult) -> _Model:
        return cls(fit, fit.problem.cell_score(own_halves(fit)))

    def or_as_it_was(self, score: Array) -> _Model:
        """The same, but for runs that the model as it was predicts better, with score (cells,).

        That has seen none of the runs. It counts for one that lacks what the others have: half of
        the run need not find the way back from there in one step.
        """
        own, run = self.own.copy(), self.fit.problem.dataset.cell_run
        for k in np.unique(run):
            if score[run == k].sum() > own[run == k].sum():
                own[run == k] = score[run == k]
        return replace(self, own=own)

    def apart(self) -> set[int]:
        """The runs without which one set of values serves the others.

        One after the other is left out, always the one that lets the rest be served best. All of
        them where no two agree.
        """
        ev = self.fit.problem.dataset
        kept, gone = set(range(len(ev.runs))), set[int]()
        while len(kept) > 2:
            gains = {k: self._gain(kept - {k}) for k in sorted(kept)}
            odd = min(gains, key=lambda k: float(np.mean(gains[k][_cells(ev, kept - {k})])))
            kept.remove(odd)
            gone.add(odd)
            if not any(_disagrees(ev, gains[odd], k) for k in kept):
                return gone
        return gone | kept

    def _gain(self, runs: set[int]) -> Array:
        """Nats by which halves of runs predict each cell better than all of `runs` do."""
        fit, ev = self.fit, self.fit.problem.dataset
        rows = np.any([run_rows(ev, k) for k in runs], axis=0)
        z = fit.z - fit.A @ step_of(fit, rows)
        return np.asarray(self.own - fit.problem.cell_score(z), dtype=np.float64)


def _cells(ev: Dataset, runs: set[int]) -> Mask:
    return np.isin(ev.cell_run, sorted(runs))


def _disagrees(ev: Dataset, gain: Array, run: int) -> bool:
    """Whether values of its own gain a run what a cause must gain to enter.

    The halves have not seen what they predict and the others' values have: without a contradiction
    the gain is below zero on average.
    """
    own = ev.cell_run == run
    return float(np.mean(gain[own])) > ev.settings.since_gain


def own_halves(fit: FitResult) -> Array:
    """White residuals of each half of a run as its other half predicts it; shape (rows,)."""
    ev = fit.problem.dataset
    z = np.array(fit.z, dtype=float)
    for k in range(len(ev.runs)):
        rows = run_rows(ev, k)
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
