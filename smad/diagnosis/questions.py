"""The two questions about recorded runs, as evidence and a model: *differs* and *changed*.

*Differs*: parameters are free from the start, and a rival acts in every run. *Changed*: the good
runs are asked first, as *differs*; the simulator that they leave is the model of the runs in
question, its parameters tied to where the good runs have them, give or take a day, until other
values of them are the answer. If runs repeat the inputs of good ones, they are compared with those
as in a check-up: what the model gets wrong is in both. Else what the good runs are left with counts
as floor: what the simulator still gets wrong everywhere is not new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.errors import GapError
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.paired.difference import Paired, paired
from smad.diagnosis.paired.good import good_runs, on_one_grid
from smad.diagnosis.paired.match import grouped, same_programme
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Effect, Mask, ModelPoint, nominal_point, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.evidence import Evidence, recorded_evidence
from smad.diagnosis.rivals.fit import covariance
from smad.diagnosis.rivals.parts import Model
from smad.diagnosis.rivals.rival import Question
from smad.diagnosis.rivals.score import Temper
from smad.diagnosis.rivals.search import Searched, searched
from smad.diagnosis.runs import GapRun
from smad.progress import Say

_MOST_CAUSES = 3
_MOST_OF_GOOD = 2
"""What the simulator lacks on the good runs is a floor for the rest: two causes take most of it."""
CORRELATED = 16.0
"""Rows that an error of the model's form is correlated over: as many count as one."""
CHANNELS = 10
"""Of the spring pair, on which κ was fitted."""
DAY = 0.05
"""How far a parameter may be from where good runs have it, in prior standard deviations."""


@dataclass(frozen=True, kw_only=True)
class Inquiry:
    """Runs that were admitted: `fit` to fit, `held_out` to judge on (or none), and `good` ones.

    `floors` (channels,) is the noise of a row of `period_s`, in channel units.
    """

    plant: PlacesPlant
    fit: tuple[GapRun, ...]
    held_out: tuple[GapRun, ...]
    good: tuple[GapRun, ...]
    effects: tuple[Effect, ...]
    period_s: float
    floors: Array
    constants: Constants
    say: Say

    def evidence(self, runs: Sequence[GapRun], point: ModelPoint, floors: Array) -> Evidence:
        """Some of the runs as rows."""
        return recorded_evidence(self.plant, runs, floors, self.period_s, point)

    def question(
        self,
        model: Model,
        fit: Sequence[GapRun],
        held_out: Sequence[GapRun],
        floors: Array,
        tied: Array | None = None,
    ) -> Question:
        """What is asked of some runs with a model."""
        point = model.start
        return question_of(
            model,
            self.evidence(fit, point, floors),
            self.effects,
            self.constants,
            self.say,
            held_out=self.evidence(held_out, point, floors) if held_out else None,
            tied=tied,
        )


def question_of(
    model: Model,
    evidence: Evidence,
    effects: Sequence[Effect],
    c: Constants,
    say: Say,
    *,
    held_out: Evidence | None = None,
    tied: Array | None = None,
    responses: Responses | None = None,
    changes: Changes | None = None,
) -> Question:
    """A question with the constants' temper; every place of the plant may be asked for a law."""
    places: PlacesPlant = model.plant  # type: ignore[assignment]
    tau = np.full(evidence.channels, CORRELATED)
    temper = temper_of(c, free=tied is None, channels=evidence.channels)
    if tied is not None:
        model = tempered(model, evidence, temper)
    return Question(
        evidence=evidence,
        held_out=held_out,
        model=model,
        tied=tied,
        effects=tuple(effects),
        responses=responses,
        changes=changes,
        places=len(places.places),
        say=say,
        tau=tau,
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
        law=0.0,
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


def day_variance(plant: PlacesPlant) -> Array:
    """Variance of each parameter from day to day, in prior deviations, (p,)."""
    day = traits_of(plant).day
    return np.array([max(day.get(q.name, 0.0), DAY) ** 2 for q in plant.parameters])


def differs(inquiry: Inquiry) -> Searched:
    """What the simulator lacks. Raises GapError where the model cannot replay the runs."""
    model = free_model(inquiry.plant, nominal_point(inquiry.plant))
    question = inquiry.question(model, inquiry.fit, inquiry.held_out, inquiry.floors)
    return _searched(question)


def changed(inquiry: Inquiry) -> tuple[Searched, Paired | None]:
    """What is new since the good runs, and the pairs that say so; None where no run repeats a good
    one. Raises GapError as `differs`."""
    groups = grouped(inquiry.plant, inquiry.good)
    pairs = []
    for run in (*inquiry.fit, *inquiry.held_out):
        same = next((g for g in groups if same_programme(inquiry.plant, run, g[0])), None)
        if same is not None:
            pairs.append((run, same))
    return _changed_pairs(inquiry, pairs) if pairs else (_changed_runs(inquiry), None)


def _changed_pairs(
    inquiry: Inquiry, repeats: Sequence[tuple[GapRun, Sequence[GapRun]]]
) -> tuple[Searched, Paired]:
    """What is new in runs beside the good ones that they repeat; what the model gets wrong is in
    both, so that it needs parameters only."""
    plant = inquiry.plant
    good = _of_good(inquiry, most=0)
    groups = {g[0].name: g for _, g in repeats}
    known = good_runs(
        plant,
        [on_one_grid(plant, g, inquiry.period_s) for g in groups.values()],
        good.start,
        inquiry.floors,
    )
    pairs = paired(plant, known, [(run, g[0].name) for run, g in repeats])
    question = question_of(
        free_model(plant, good.start),
        pairs.evidence(),
        inquiry.effects,
        inquiry.constants,
        inquiry.say,
        tied=good.tied,
    )
    return _searched(question), pairs


def _changed_runs(inquiry: Inquiry) -> Searched:
    """What is new in runs with inputs of their own."""
    good = _of_good(inquiry, most=_MOST_OF_GOOD)
    model = free_model(inquiry.plant, good.start)
    new = inquiry.question(model, inquiry.fit, inquiry.held_out, good.floors, good.tied)
    # What the good runs leave above the noise is the model's form, and stands in these runs, too. A
    # lead may come from any channel: the one with the largest share decides.
    form = 1.0 - (inquiry.floors / good.floors)[good.recorded] ** 2
    return _searched(replace(new, form_share=float(form.max()), good=len(inquiry.good)))


@dataclass(frozen=True, kw_only=True)
class _Good:
    """What the good runs say: the model, how surely its parameters are there (p, p), and floors
    (channels,) that hold what it leaves of them; `recorded` are the channels that they have."""

    start: ModelPoint
    tied: Array
    floors: Array
    recorded: Mask


def _of_good(inquiry: Inquiry, *, most: int) -> _Good:
    """The good runs, asked as *differs*: parameters, and at `most` so many causes."""
    plant = inquiry.plant
    n = len(plant.parameters)
    inquiry.say("the good runs")
    model = free_model(plant, nominal_point(plant))
    question = inquiry.question(model, inquiry.good, (), inquiry.floors)
    good = _searched(question, most=most, exchange=False)
    counts = question.judged.counts.sum(axis=0)
    left = np.sqrt(good.final.squares.sum(axis=0) / np.maximum(counts, 1.0))
    start, known = model.start, np.diag(day_variance(plant))
    if good.final.fit is not None:
        start = good.final.fit.point
        known = known + covariance(question.evidence, good.final.fit, question.tau)[:n, :n]
    return _Good(
        start=start,
        tied=np.asarray(np.linalg.inv(known)),
        floors=inquiry.floors * np.maximum(left, 1.0),
        recorded=counts > 0,
    )


def _searched(question: Question, *, most: int = _MOST_CAUSES, exchange: bool = True) -> Searched:
    search = searched(question, most=most, exchange=exchange)
    if search is None:
        raise cannot_replay(question)
    return search


def cannot_replay(question: Question) -> GapError:
    """The model gives no numbers for the runs."""
    names = [p.whole.name for p in question.evidence.played]
    return GapError(
        "the model cannot replay these runs",
        value=", ".join(names),
        action="leave them out, or correct the model where it stops",
    )
