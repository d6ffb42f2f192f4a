"""The experiment by which the places that runs leave confused differ most."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import msgspec
import numpy as np

from sim_device.plant.laws import joined
from smad.diagnosis.answer import Answer
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.plant import Array, Experimenter, ModelPoint
from smad.diagnosis.search.told import side_words
from smad.diagnosis.search.where import Fits, fits


class Offer(msgspec.Struct, frozen=True, kw_only=True):
    """An experiment of the plant's catalogue, and the smallest d² between two of the places."""

    name: str
    title: str
    duration_s: float
    separation: float
    command: str


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
    plant, scale = settler.plant, settler.gap.scale
    base = settler.start
    places = {p.name: p for p in plant.places}
    words, points = [], []
    for one in step.near:
        own: Fits = fits(answer.rows, [replace(step, chosen=one)])
        laws = settler.found.law_of(own.columns, own.fit.mean)
        points.append(ModelPoint(settler.gap.point.theta, base.effects,
                                 joined((*base.laws, *laws))))  # fmt: skip
        words.append(side_words(places[one.candidate.place], one.candidate.side))
    out: list[Offer] = []
    if not isinstance(plant, Experimenter):
        return words, out
    for experiment in plant.catalogue():
        progress(experiment.title)
        run = plant.perform(experiment.name, replace(base, laws=()), 0)
        played = Played.of(run, float(run.t_s[0] - run.dt_s), settler.gap.played[0].period_s)
        told = [predictions(plant, point, [played])[0] / scale for point in points]
        out.append(
            Offer(
                name=experiment.name, title=experiment.title, command=experiment.command,
                duration_s=experiment.duration_s, separation=_least(told),
            )
        )  # fmt: skip
    return words, sorted(out, key=lambda o: (-o.separation, o.name))


def _least(told: list[Array]) -> float:
    pairs = [
        float(((a - b) ** 2).sum())
        for i, a in enumerate(told)
        for b in told[i + 1 :]
        if np.isfinite(a).all() and np.isfinite(b).all()
    ]
    return min(pairs, default=0.0)
