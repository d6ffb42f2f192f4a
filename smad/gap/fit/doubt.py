"""What a second cause must stand beside: the first, whose law is only roughly that of the bench.

A library's law has a form of its own. Fitted to a bench that follows another one, it leaves part of
what it explains, in the same places; whatever has some freedom there gains by that, and would pass
for a second cause. What a cause changes is therefore uncertain by a share of itself, as K_δ is what
the model without a cause is uncertain by.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from smad.gap.data.replay import Detail
from smad.gap.fit.judge import Judged
from smad.gap.fit.lsq import FitResult, Problem
from smad.gap.plant import Array


@dataclass(frozen=True)
class Doubt:
    """The runs that a model is judged on, weighed as its causes may be somewhat wrong."""

    problem: Problem
    hold: Problem | None

    @classmethod
    def about(cls, fit: FitResult, judged: Judged) -> Doubt:
        """The doubt about the causes of a model; none where it has no cause."""
        problem, hold = judged.problem, judged.hold
        points = [fit.point, *(fit.without(cause.name) for cause in fit.space.effects)]
        if len(points) == 1:
            return cls(problem, hold)
        return cls(
            _doubted(problem, problem.dataset.predict(points)),
            None
            if hold is None
            else _doubted(hold, hold.dataset.predict(points, detail=Detail.FINE)),
        )

    def scores(self, judged: Judged) -> Array:
        """Log-likelihood of every held-out cell, as `Judged.scores`."""
        return replace(judged, problem=self.problem, hold=self.hold).scores()


def _doubted(problem: Problem, predicted: Array) -> Problem:
    """The problem with a share of what each cause changes added to what is not known.

    `predicted`: with all causes, then without each, shape (1 + causes, rows). The share is of the
    root mean square over a cell: where a wrong law is off is not where it is large to the bin.
    """
    ev = problem.dataset
    share = ev.settings.form_share
    change = np.where(ev.valid, predicted[0] - predicted[1:], 0.0)
    square = ev.cell_sum(np.square(change).sum(axis=0)) / np.maximum(ev.cell_size, 1.0)
    unsure = share * np.sqrt(square)[ev.row_cell]
    return replace(problem, whitening=problem.whitening.beside(unsure))
