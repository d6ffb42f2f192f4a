"""What a question is made of: a model with its priors, evidence, and what weighs rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.errors import GapError
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Array, Effect, ModelPoint, PlantModel, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence
from smad.diagnosis.rivals.parts import Model
from smad.diagnosis.rivals.rival import Question
from smad.diagnosis.rivals.score import Temper
from smad.progress import Say

CHANNELS = 10
"""Of the spring pair, on which κ was fitted."""
DAY = 0.05
"""How far a parameter may be from where good runs have it, in prior standard deviations."""


def question_of(
    plant: PlacesPlant,
    start: ModelPoint,
    evidence: Evidence,
    *,
    effects: Sequence[Effect],
    constants: Constants,
    say: Say,
    held_out: Evidence | None = None,
    tied: Array | None = None,
    responses: Responses | None = None,
    changes: Changes | None = None,
) -> Question:
    """What is asked of a plant at `start`; with `tied` its parameters stay near there."""
    temper = temper_of(constants, free=tied is None, channels=evidence.channels)
    model = free_model(plant, start)
    return Question(
        evidence=evidence,
        held_out=held_out,
        model=model if tied is None else tempered(model, evidence, temper),
        tied=tied,
        effects=tuple(effects),
        responses=responses,
        changes=changes,
        say=say,
        temper=temper,
    )


def temper_of(c: Constants, *, free: bool, channels: int = CHANNELS) -> Temper:
    """What weighs rivals. Where parameters are `free` in every rival, other values of them without
    a part are the simulator in which nothing is missing. Fewer `channels` say as much together."""
    parameters = c.nothing if free else c.parameters
    return Temper(
        evidence=c.evidence * CHANNELS / channels,
        nothing=c.nothing,
        parameters=parameters,
        effect=c.effect,
    )


def free_model(plant: PlacesPlant, start: ModelPoint) -> Model:
    """A model whose parameters have the plant's priors around a point."""
    n = len(plant.parameters)
    return Model(
        plant=plant, start=start, parameter_mean=np.zeros(n), parameter_precision=np.eye(n)
    )


def tempered(model: Model, evidence: Evidence, temper: Temper) -> Model:
    """The model whose fit counts the prior as much more as a score counts fewer rows."""
    rows = float((evidence.counts / CORRELATED)[evidence.counts > 0].mean())
    return replace(model, rows_as_one=max(rows / temper.evidence, 1.0))


def day_variance(plant: PlantModel) -> Array:
    """Variance of each parameter from day to day, in prior deviations, (p,)."""
    day = traits_of(plant).day
    return np.array([max(day.get(q.name, 0.0), DAY) ** 2 for q in plant.parameters])


def cannot_replay(question: Question) -> GapError:
    """The model gives no numbers for the runs."""
    names = [p.whole.name for p in question.evidence.played]
    return GapError(
        "the model cannot replay these runs",
        value=", ".join(names),
        action="leave them out, or correct the model where it stops",
    )
