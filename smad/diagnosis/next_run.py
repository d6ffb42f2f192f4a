"""Which experiment of the catalogue separates the rivals that remain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from smad.diagnosis.answer import Answer
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.places.bare import unwrapped
from smad.diagnosis.plant import Array, Experiment, Experimenter
from smad.diagnosis.rivals.describe import rival_words
from smad.diagnosis.rivals.evidence import without_drifts
from smad.progress import Say, silent

_SHOWN = 4


@dataclass(frozen=True)
class Offer:
    """An experiment of the plant's catalogue, and the smallest d² between two of the rivals."""

    experiment: Experiment
    separation: float


def offers(answer: Answer, progress: Say = silent) -> tuple[list[str], list[Offer]]:
    """The rivals that remain, in words, and experiments, the one that separates them most first.

    d² is the squared distance of two rivals' predictions in standard deviations of a row; the
    residual of the fits counts as noise. Both lists are empty where one rival remains.
    """
    search, fits = answer.search, [r.fitted for r in answer.alternatives]
    if search is None or len(fits) < 2:
        return [], []
    evidence, model = search.question.evidence, search.question.model
    plant = model.plant
    residual = (without_drifts(evidence, f.residual) for f in fits)
    variances = min(map(evidence.variances, residual), key=lambda v: v.sum())
    scale = evidence.floors * np.sqrt(np.maximum(variances, 1.0))
    words = [rival_words(plant, r) for r in answer.alternatives]
    out: list[Offer] = []
    experimenter = unwrapped(plant)
    if not isinstance(experimenter, Experimenter):
        return words, out
    for experiment in experimenter.catalogue():
        progress(experiment.title)
        run = experimenter.perform(experiment.name, replace(model.start, laws=()), 0)
        period_s = evidence.played[0].period_s
        played = Played.of(run, plant.inputs, run.begins_s, period_s)
        predicted = [predictions(plant, f.point, [played])[0] / scale for f in fits]
        out.append(Offer(experiment, separation(predicted)))
    return words, sorted(out, key=lambda o: (-o.separation, o.experiment.name))


def offer_lines(confused: Sequence[str], ranked: Sequence[Offer]) -> list[str]:
    """The result of `offers` in words, with the commands of the best few experiments."""
    if not confused:
        return ["No two rivals remain: no run is needed to separate them."]
    lines = [f"Not separated: {' or '.join(confused)}. Least d² between two of them:"]
    for offer in ranked[:_SHOWN]:
        x = offer.experiment
        d2 = f"d² {offer.separation:>7.1f}"
        lines.append(f"  {d2}  {x.duration_s:>4.0f} s  {x.title}:  {x.command}")
    return lines


def separation(predicted: Sequence[Array]) -> float:
    """The least d² between two predictions (n, …); 0 where one of them is not finite."""
    if not all(np.isfinite(x).all() for x in predicted):
        return 0.0
    return min((float(((a - b) ** 2).sum()) for a, b in combinations(predicted, 2)), default=0.0)
