"""The places of a model's effects: what else could stand there, and how probably."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.gap.fit.candidate import Candidate, differing, held_cells
from smad.gap.fit.lsq import Problem
from smad.gap.fit.significance import DRAWS, resample_weights


@dataclass(frozen=True)
class Place:
    """What can stand where an effect of the best model does: nothing (`empty`), or a rival."""

    empty: Candidate
    rivals: tuple[Candidate, ...]


def posterior(name: str, place: Place, best: Candidate, hold: Problem | None) -> dict[str, float]:
    """Probability of each effect in one place, by a Bayesian bootstrap over runs and blocks.

    `name` is the effect of `best` that stands there, "" where it has none.
    """
    models = {"": place.empty, **{differing(best, c): c for c in place.rivals}, name: best}
    names = sorted(models)
    # Beside the other causes, whose laws are no surer here than when this one entered.
    scores = np.array([place.empty.doubt.scores(models[n].judged) for n in names])
    settings = best.fit.problem.evidence.settings
    runs, blocks = held_cells(best.fit.problem, hold)
    rng = np.random.default_rng(settings.seed + 17)
    total = resample_weights(runs, blocks, DRAWS, rng) @ scores.T
    total -= total.max(axis=1, keepdims=True)
    shares = np.exp(total)
    shares /= shares.sum(axis=1, keepdims=True)
    return dict(zip(names, shares.mean(axis=0).tolist(), strict=True))
