"""The experiment by which the places that runs leave confused differ most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sim_device.plant.laws import joined
from smad.diagnosis.answer import Answer
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.plant import Array, Experiment, Experimenter, ModelPoint
from smad.diagnosis.search.locate import law_alone
from smad.diagnosis.search.told import words_of


@dataclass(frozen=True)
class Offer:
    """An experiment of the plant's catalogue, and the smallest d² between two of the places."""

    experiment: Experiment
    separation: float


def offers(
    answer: Answer, progress: Callable[[str], None] = lambda text: None
) -> tuple[list[str], list[Offer]]:
    """The places that are confused, in words, and experiments, the one that parts them most first.

    d² is the squared difference of two laws' predictions in standard deviations of a row, what
    the model leaves of its runs counted as noise; both laws are those that explain these runs.
    Both lists are empty where nothing is confused.
    """
    listing = answer.listed
    confused = [s for s in listing.steps if len(s.near) > 1] if listing else []
    if listing is None or not confused or answer.rows is None:
        return [], []
    step = confused[0]
    settler = listing.settler
    plant, scale = settler.gap.plant, settler.gap.white.runs[0].sd[0]
    base = settler.start
    points = [
        ModelPoint(settler.gap.point.theta, base.effects,
                   joined((*base.laws, *law_alone(settler.found, answer.rows, step, one))))
        for one in step.near
    ]  # fmt: skip
    words = [words_of(plant, one.candidate) for one in step.near]
    out: list[Offer] = []
    if not isinstance(plant, Experimenter):
        return words, out
    for experiment in plant.catalogue():
        progress(experiment.title)
        run = plant.perform(experiment.name, replace(base, laws=()), 0)
        played = Played.of(run, float(run.t_s[0] - run.dt_s), settler.gap.played[0].period_s)
        told = [predictions(plant, point, [played])[0] / scale for point in points]
        out.append(Offer(experiment, separation(told)))
    return words, sorted(out, key=lambda o: (-o.separation, o.experiment.name))


def separation(told: Sequence[Array]) -> float:
    """The least d² between two of what laws tell of a run; 0 where one of them is no number."""
    if not all(np.isfinite(x).all() for x in told):
        return 0.0
    return min((float(((a - b) ** 2).sum()) for a, b in combinations(told, 2)), default=0.0)
