"""How hypotheses that differ in one place score on what they were not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.gap.data.replay import Index
from smad.gap.fit.hypothesis import Hypothesis, differing, held_cells
from smad.gap.fit.resample import DRAWS, resample_weights
from smad.gap.plant import Array


@dataclass(frozen=True)
class Place:
    """What can stand where an effect of the best model does: nothing (`empty`), or a rival."""

    empty: Hypothesis
    rivals: tuple[Hypothesis, ...]


@dataclass(frozen=True)
class ScoreTable:
    """Held-out log-likelihood of hypotheses, cell by cell.

    `names` are the effects that stand in the place, "" being none; `scores` (hypotheses, cells);
    `run` and `block` (cells,) say where a cell lies; `seed` draws the resamples.
    """

    names: tuple[str, ...]
    scores: Array
    run: Index
    block: Index
    seed: int

    @classmethod
    def of(cls, name: str, place: Place, best: Hypothesis) -> ScoreTable:
        """Of a place in which `best` has the effect `name`, "" for none.

        Beside the other causes, whose laws are no surer here than when this one entered.
        """
        models = {"": place.empty, **{differing(best, c): c for c in place.rivals}, name: best}
        names = tuple(sorted(models))
        run, block = held_cells(best.fit.problem, best.judged.hold)
        scores = np.array([place.empty.doubt.scores(models[n].judged) for n in names])
        return cls(names, scores, run, block, best.fit.problem.dataset.settings.seed + 17)

    def probability(self) -> dict[str, float]:
        """Of each hypothesis, by name: its mean share over a Bayesian bootstrap of the cells."""
        weights = resample_weights(self.run, self.block, DRAWS, np.random.default_rng(self.seed))
        total = weights @ self.scores.T
        shares = np.exp(total - total.max(axis=1, keepdims=True))
        shares /= shares.sum(axis=1, keepdims=True)
        return dict(zip(self.names, shares.mean(axis=0).tolist(), strict=True))
