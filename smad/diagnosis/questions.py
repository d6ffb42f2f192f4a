"""The two questions about recorded runs, as evidence and a model: *differs* and *changed*.

*Differs*: the parameters are free from the start, and a rival acts in every run. *Changed*: a
search on the good runs comes first. Its result is the model of the runs in question, with the
parameters tied to their values there within a day's variation, until other values of them enter.
Runs that repeat the inputs of good ones are compared with those as in a check-up, so that model
errors cancel. For other runs the residual of the good runs is added to the floors: such an error is
not new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.rows import grouped, same_programme
from smad.diagnosis.paired.difference import PairedRuns, pair_runs, question_of_pairs
from smad.diagnosis.paired.good import good_runs
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
"""Parts that may enter on the good runs: two explain most, and the rest becomes floor."""


@dataclass(frozen=True, kw_only=True)
class AdmittedRuns:
    """Admitted runs to `fit`, `held_out` to judge on (may be empty) and `good`, in rows of
    `period_s`; candidate `effects`."""

    plant: PlacesPlant
    fit: tuple[GapRun, ...]
    held_out: tuple[GapRun, ...]
    good: tuple[GapRun, ...]
    effects: tuple[Effect, ...]
    period_s: float
    say: Say

    def of(self, names: Sequence[str]) -> AdmittedRuns:
        """Only these runs in question, with all good ones; if all are held out, they are fitted."""
        fit = tuple(run for run in self.fit if run.name in names)
        held_out = tuple(run for run in self.held_out if run.name in names)
        return replace(self, fit=fit or held_out, held_out=held_out if fit else ())

    @cached_property
    def floors(self) -> Array:
        """Floors of a row over all runs, in channel units, (channels,)."""
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
        """The question about runs to fit and held out, with the model at `start`."""

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
    """Search for what the simulator lacks. Raises GapError where it cannot replay the runs."""
    start = nominal_point(admitted.plant)
    return run_search(admitted.question(start, admitted.fit, admitted.held_out, admitted.floors))


def changed_pairs(admitted: AdmittedRuns) -> tuple[Search, PairedRuns] | None:
    """Search runs that repeat good ones for changes; return the pairs, too, or None without any.

    Raises GapError as `differs`.
    """
    # A replay in windows starts from the readings, which differ from day to day: nothing cancels.
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
    good = good_runs(admitted.plant, groups, admitted.effects, admitted.period_s, say=admitted.say)
    pairs = pair_runs(admitted.plant, good, repeats)
    question = question_of_pairs(pairs, admitted.effects, admitted.say)
    return run_search(question), pairs


def changed_runs(admitted: AdmittedRuns) -> Search:
    """Search runs with inputs of their own for changes. Raises GapError as `differs`."""
    plant = admitted.plant
    n = len(plant.parameters)
    admitted.say("the good runs")
    question = admitted.question(nominal_point(plant), admitted.good, (), admitted.floors)
    good = run_search(question, most=_MOST_OF_GOOD, exchange=False)
    floors = admitted.floors * np.maximum(question.channel_gaps(good.final), 1.0)
    # The good runs determine the parameters even if none of them has moved.
    known = good.final.fit or good.parameters.fitted
    covariance = Precision.at_fit(question.evidence, known).covariance(known)[:n, :n]
    tied = np.asarray(np.linalg.inv(np.diag(day_variance(plant)) + covariance))
    start = question.point_of(good.final)
    new = admitted.question(start, admitted.fit, admitted.held_out, floors, tied)
    # The residual of the good runs above the noise is model error, which these runs have, too.
    form = 1.0 - (admitted.floors / floors) ** 2
    new = replace(
        new,
        form_shares=form if form.any() else None,
        good=len(admitted.good),
    )
    return run_search(new)
