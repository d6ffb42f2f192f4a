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
from functools import cached_property, partial

import numpy as np

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.paired.difference import PairedRuns, pair_runs, question_of_pairs
from smad.diagnosis.paired.good import good_runs
from smad.diagnosis.paired.match import grouped, same_programme
from smad.diagnosis.places.bare import InWindows, unwrapped
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.plant import Array, Effect, ModelPoint, nominal_point
from smad.diagnosis.rivals.evidence import Evidence, recorded_evidence
from smad.diagnosis.rivals.rival import Question, day_variance, question_of
from smad.diagnosis.rivals.search import Search, run_search
from smad.diagnosis.rivals.uncertainty import Precision
from smad.diagnosis.runs import GapRun
from smad.progress import Say

_MOST_OF_GOOD = 2
"""What the simulator lacks on the good runs is a floor for the rest: two causes take most of it."""


@dataclass(frozen=True, kw_only=True)
class AdmittedRuns:
    """Runs that were admitted: `fit` to fit, `held_out` to judge on (or none), and `good` ones.

    Rows are of `period_s`.
    """

    plant: PlacesPlant
    fit: tuple[GapRun, ...]
    held_out: tuple[GapRun, ...]
    good: tuple[GapRun, ...]
    effects: tuple[Effect, ...]
    period_s: float
    say: Say

    def of(self, names: Sequence[str]) -> AdmittedRuns:
        """The same of some runs in question; if all are held out, they are fitted as well."""
        fit, held_out = (
            tuple(run for run in runs if run.name in names) for runs in (self.fit, self.held_out)
        )
        return replace(self, fit=fit or held_out, held_out=held_out if fit else ())

    @cached_property
    def floors(self) -> Array:
        """What a residual of a row is measured by, in channel units, (channels,)."""
        runs = (*self.fit, *self.held_out, *self.good)
        return estimate_floors(runs, self.plant, self.period_s)

    def question(
        self,
        start: ModelPoint,
        fit: Sequence[GapRun],
        held_out: Sequence[GapRun],
        floors: Array,
        tied: Array | None = None,
    ) -> Question:
        """What is asked of some runs with the model at `start`."""

        def rows(runs: Sequence[GapRun]) -> Evidence:
            return recorded_evidence(self.plant, runs, floors, self.period_s, start)

        return question_of(
            self.plant,
            start,
            rows(fit),
            effects=self.effects,
            say=self.say,
            held_out=rows(held_out) if held_out else None,
            tied=tied,
        )


def differs(admitted: AdmittedRuns) -> Search:
    """What the simulator lacks. Raises GapError where the model cannot replay the runs."""
    start = nominal_point(admitted.plant)
    return run_search(admitted.question(start, admitted.fit, admitted.held_out, admitted.floors))


def changed_pairs(admitted: AdmittedRuns) -> tuple[Search, PairedRuns] | None:
    """What is new in runs that repeat good ones, and the pairs that say so; None where no run does.

    Raises GapError as `differs`.
    """
    # What is replayed from its readings begins elsewhere on another day: nothing cancels.
    comparable = () if isinstance(unwrapped(admitted.plant), InWindows) else admitted.good
    same = partial(same_programme, admitted.plant, period_s=admitted.period_s)
    groups = grouped(comparable, same)
    repeats = []
    for run in (*admitted.fit, *admitted.held_out):
        repeated = next((good for good, *_ in groups if same(run, good)), None)
        if repeated is not None:
            repeats.append((run, repeated.name))
    if not repeats:
        return None
    admitted.say("the good runs")
    good = good_runs(admitted.plant, groups, admitted.period_s)
    pairs = pair_runs(admitted.plant, good, repeats)
    question = question_of_pairs(pairs, admitted.effects, admitted.say)
    return run_search(question), pairs


def changed_runs(admitted: AdmittedRuns) -> Search:
    """What is new in runs with inputs of their own. Raises GapError as `differs`."""
    plant = admitted.plant
    n = len(plant.parameters)
    admitted.say("the good runs")
    question = admitted.question(nominal_point(plant), admitted.good, (), admitted.floors)
    good = run_search(question, most=_MOST_OF_GOOD, exchange=False)
    counts = question.judged.counts.sum(axis=0)
    rms = np.sqrt(good.final.squares.sum(axis=0) / np.maximum(counts, 1.0))
    floors = admitted.floors * np.maximum(rms, 1.0)
    uncertainty = np.diag(day_variance(plant))
    start = question.model.start
    if good.final.fit is not None:
        start = good.final.fit.point
    # What good runs say of the parameters they say also where none of them has to move.
    known = good.final.fit or good.parameters.fit
    if known is not None:
        precision = Precision.at(question.evidence, known)
        uncertainty = uncertainty + precision.covariance(known)[:n, :n]
    tied = np.asarray(np.linalg.inv(uncertainty))
    new = admitted.question(start, admitted.fit, admitted.held_out, floors, tied)
    # What the good runs leave above the noise is the model's form, and stands in these runs, too. A
    # lead may come from any channel: the one with the largest share decides.
    form = 1.0 - (admitted.floors / floors)[counts > 0] ** 2
    return run_search(replace(new, form_share=float(form.max()), good=len(admitted.good)))
