"""A rival (a fitted hypothesis), and the question that it answers.

A rival is judged by its residual on rows that it was not fitted to: runs held out, replayed as
recorded, or each fold in turn (`left_out`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import msgspec
import numpy as np

from smad.counted import counted
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.errors import GapError
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Array, Effect, ModelPoint, PlantModel, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.convergence import fit_to_end
from smad.diagnosis.rivals.evidence import Evidence, form_sd_of
from smad.diagnosis.rivals.fit import Fit, Reference, fit, reference_of, replayed
from smad.diagnosis.rivals.left_out import Predicted, left_out_predictions, squares_left, stitched
from smad.diagnosis.rivals.parts import Model, Part
from smad.diagnosis.rivals.score import (
    EFFECT,
    LAW,
    NOTHING,
    effective_rows,
    log_scores,
    probabilities,
    quiet_gap,
)
from smad.diagnosis.verdict import AT_FLOOR
from smad.progress import Say

CHANNELS = 10
"""Channels of the spring pair, on which κ was fitted."""
DAY = 0.05
"""Least standard deviation of a parameter from day to day, in prior standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rival:
    """A hypothesis with its fit (None for the simulator as configured) and its residual.

    `squares` (judged runs, channels) are sums in floors over rows that it was not fitted to,
    `scores` (judged runs,) those of `log_scores`, `log_prior` is that of its parameters.
    """

    kind: str
    name: str
    fit: Fit | None
    squares: Array
    scores: Array
    log_prior: float = 0.0
    probability: float = 0.0

    @property
    def has_part(self) -> bool:
        """Whether it adds an effect or a law to the simulator."""
        return self.kind in (EFFECT, LAW)

    @property
    def fitted(self) -> Fit:
        """The fit of a rival other than the simulator as configured."""
        assert self.fit is not None
        return self.fit

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of its model, the last of which it was made for if it `has_part`."""
        return self.fit.model.parts if self.fit is not None else ()

    @property
    def places(self) -> tuple[str, ...]:
        """Where its last part acts; empty for a rival without a part."""
        return self.parts[-1].places if self.has_part else ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """Evidence to fit, evidence held out (or None), and the model that is fitted.

    `effects` are the candidates, `constants` those of the score for the channels of these runs.
    `tied` (p, p) is the precision of the parameters' prior until other values of them enter; None:
    they are free from the start. `responses` of laws and `changes` by effects are given where they
    are known already. `form_shares` (channels,) are the shares of a floor's square that are model
    error (None: none is), and `good` the number of runs that they were measured on. `form_sd`
    (bins, channels) of each judged run is the form error of the parts that have entered, in channel
    units; empty before.
    """

    evidence: Evidence
    held_out: Evidence | None
    model: Model
    tied: Array | None
    responses: Responses | None
    changes: Changes | None
    effects: tuple[Effect, ...]
    constants: Constants
    say: Say
    form_shares: Array | None = None
    good: int = 0
    form_sd: tuple[Array, ...] = ()

    @property
    def judged(self) -> Evidence:
        """The runs that rivals are judged on."""
        return self.evidence if self.held_out is None else self.held_out

    @property
    def judged_on(self) -> str:
        """What rivals are judged on, in words."""
        count = len(self.judged.trials)
        if self.held_out is not None:
            return f"{counted(count, 'run')} held out"
        runs = "the one run" if count == 1 else f"{count} runs"
        stretches = "" if self.evidence.by_runs else "stretches of "
        return f"{stretches}{runs}, each by a model fitted to the others"

    @cached_property
    def scored_evidence(self) -> Evidence:
        """The judged runs with the `form_sd` of the parts that have entered in their floors."""
        pairs = zip(self.judged.trials, self.form_sd, strict=True)
        return replace(self.judged, trials=tuple(t.with_added_sd(sd) for t, sd in pairs))

    def with_form_of(self, fitted: Fit) -> Question:
        """The question with the form error of a fit's parts in `form_sd`, as their residual shows
        it.

        The question itself where the model fails.
        """
        e, count = self.judged, len(fitted.model.parts)
        predicted = self.predicted(fitted)
        fewer = [fitted.of_parts([k for k in range(count) if k != i]) for i in range(count)]
        whole, *without = (replayed(e, f.point, f.model, exact=True) for f in (fitted, *fewer))
        if predicted is None or whole is None:
            return self
        moved = [np.zeros_like(p) for p in whole]
        for without_one in without:
            if without_one is None:
                return self
            changes = (a - b for a, b in zip(whole, without_one, strict=True))
            moved = [np.hypot(so_far, c) for so_far, c in zip(moved, changes, strict=True)]
        return replace(self, form_sd=form_sd_of(e, stitched(e, predicted), moved))

    def rival(self, kind: str, name: str, fitted: Fit) -> Rival | None:
        """A fit as a rival; None where the model fails on the judged runs."""
        predicted = self.predicted(fitted)
        if predicted is None:
            return None
        rival = self._leaving(predicted, kind, name, fitted)
        return replace(rival, log_prior=fitted.model.log_prior(fitted.x))

    def converged(
        self, kind: str, name: str, reference: Reference, *, near: bool = False
    ) -> Rival | None:
        """The model of a reference fitted to convergence, as a rival; see `fit_to_end`."""
        fitted = fit_to_end(self.evidence, reference, near=near)
        return None if fitted is None else self.rival(kind, name, fitted)

    def refit_with_tempered_prior(self, kind: str, name: str, free: Fit) -> Rival | None:
        """Continue a fit of free parameters with the tempered prior; None where the model fails.

        With few runs free parameters follow noise: a fit counts every row, and so moves them
        further from the prior than the tempered score rewards.
        """
        reference = reference_of(self.evidence, free)
        model = with_tempered_prior(free.model, self.evidence, self.constants)
        fitted = reference and fit(self.evidence, model, free.x, reference)
        steady = self.rival(kind, name, fitted) if fitted else None
        return steady and replace(steady, fit=replace(steady.fitted, model=free.model))

    def of_point(self, point: ModelPoint) -> Rival | None:
        """A simulator that was not fitted, as a rival; None where it fails."""
        predicted = replayed(self.judged, point, self.model, exact=True)
        if predicted is None:
            return None
        return self._leaving([Predicted.of_all(self.judged, predicted)], NOTHING, NOTHING, None)

    def _leaving(
        self, predicted: Sequence[Predicted], kind: str, name: str, fitted: Fit | None
    ) -> Rival:
        """A rival with the residual of its prediction of the judged runs, less the drifts."""
        squares = squares_left(self.judged, predicted)
        wider = squares_left(self.scored_evidence, predicted) if self.form_sd else squares
        scores = log_scores(wider, self.judged.counts, self.judged.least_square)
        return Rival(kind=kind, name=name, fit=fitted, squares=squares, scores=scores)

    def point_of(self, rival: Rival) -> ModelPoint:
        """The simulator of a rival."""
        return self.model.start if rival.fit is None else rival.fit.point

    def at_floor(self, rival: Rival) -> bool:
        """Whether a rival's residual is at the floor in every channel of the judged runs."""
        counts = self.judged.counts.sum(axis=0)
        return bool((rival.squares.sum(axis=0) <= AT_FLOOR**2 * counts).all())

    def gap(self, rival: Rival) -> float:
        """Root mean square of a rival's residual on the judged runs, in floors."""
        return float(np.sqrt(rival.squares.sum() / max(self.judged.counts.sum(), 1.0)))

    def channel_gaps(self, rival: Rival) -> Array:
        """The gap in each channel, in floors, (channels,); 0 where it has no reading."""
        counts = self.judged.counts.sum(axis=0)
        return np.asarray(np.sqrt(rival.squares.sum(axis=0) / np.maximum(counts, 1.0)))

    @property
    def independent_rows(self) -> float:
        """Independent rows of a judged run and channel, on average."""
        rows = self.judged.independent_rows
        if self.form_shares is None:
            return rows
        # A rival may lead in any channel.
        return effective_rows(rows, float(self.form_shares.max()), shipped().evidence, self.good)

    def is_quiet(self, rival: Rival) -> bool:
        """Whether a simulator that lacks nothing may leave as large a gap as a rival, over all
        channels and, where floors include model error, in each.
        """
        e, gap = self.judged, self.gap(rival)
        limit = partial(quiet_gap, kappa=shipped().evidence, runs=len(e.trials), good=self.good)
        if self.form_shares is None:
            return gap <= limit(0.0)
        mean_share = float(np.average(self.form_shares, weights=e.counts.sum(axis=0)))
        # A channel that good runs left at its noise may have model error in new ones: it counts as
        # if its whole floor were that.
        limit_of_channel = limit(1.0, tests=e.recorded)
        return gap <= limit(mean_share) and bool(self.channel_gaps(rival).max() <= limit_of_channel)

    def refuted(self, rivals: Sequence[Rival]) -> list[bool]:
        """Which rivals are not quiet while another one is.

        Where floors include model error, κ is too small to refute a simulator by its score.
        Elsewhere a rival with a new part may be nearly right, and is not refuted; where a part has
        entered beside tied parameters, none is.
        """
        above = [not self.is_quiet(r) for r in rivals]
        if all(above) or self.form_sd:
            return [False] * len(above)
        return [
            too_much and (self.form_shares is not None or not r.has_part)
            for too_much, r in zip(above, rivals, strict=True)
        ]

    def incomplete(self, rivals: Sequence[Rival]) -> bool:
        """Whether no rival without a new part, with free parameters too, is quiet.

        Then something is missing for certain, and the question is only whether a rival describes
        it. Beside a part, parameters that good runs tie are not free, and its form leaves a gap.
        """
        return not self.form_sd and not any(self.is_quiet(r) for r in rivals if not r.has_part)

    def ranked(
        self, rivals: Sequence[Rival], *, by_rows: bool = False, missing: bool = False
    ) -> list[Rival]:
        """Rivals with their probabilities, the likeliest first.

        `by_rows`: every row counts against a simulator without a new part, since it may be right.
        `missing`: it surely lacks something.
        """
        refuted = self.refuted(rivals)
        constants = self.constants.of_unknown if missing else self.constants
        compared = [r for r, out in zip(rivals, refuted, strict=True) if not out]
        # Parameters that a prior holds back leave a little without being wrong in form.
        same = [r.fit.model for r in compared if r.fit and not r.has_part]
        formed = by_rows or any(model.parts for model in same)
        at_floor = [formed and self.at_floor(r) for r in compared]
        p = probabilities(
            self._compared(compared, at_floor),
            [r.kind for r in compared],
            constants,
            effects=len(self.effects),
            laws=len(self.model.plant.places),
            log_prior=np.array([r.log_prior for r in compared]),
            rows=self.independent_rows,
            by_rows=by_rows,
            at_floor=at_floor,
        )
        ranked = [replace(r, probability=float(x)) for r, x in zip(compared, p, strict=True)]
        ranked += [
            replace(r, probability=0.0) for r, out in zip(rivals, refuted, strict=True) if out
        ]
        return sorted(ranked, key=lambda r: -r.probability)

    def _compared(self, rivals: Sequence[Rival], at_floor: Sequence[bool]) -> Array:
        """Scores (rivals, runs). If only rivals with a new part are `at_floor`, the parts before
        are right in form, and the scores are taken without `form_sd`.
        """
        have_part = {r.has_part for r, low in zip(rivals, at_floor, strict=True) if low}
        e = self.judged
        if self.form_sd and have_part == {True}:
            return np.array([log_scores(r.squares, e.counts, e.least_square) for r in rivals])
        return np.array([r.scores for r in rivals])

    def log_weight(self, rival: Rival) -> float:
        """Log weight by which two fits of one kind are compared: tempered score plus log prior."""
        return float(0.5 * self.constants.evidence * rival.scores.sum() + rival.log_prior)

    def predicted(self, fitted: Fit) -> list[Predicted] | None:
        """Out-of-sample predictions of the judged runs by a fit; None where the model fails."""
        if self.held_out is None:
            return left_out_predictions(self.evidence, fitted)
        replay = replayed(self.held_out, fitted.point, fitted.model, exact=True)
        return None if replay is None else [Predicted.of_all(self.held_out, replay)]


def question_of(
    plant: PlacesPlant,
    start: ModelPoint,
    evidence: Evidence,
    *,
    effects: Sequence[Effect],
    say: Say,
    held_out: Evidence | None = None,
    tied: Array | None = None,
    responses: Responses | None = None,
    changes: Changes | None = None,
) -> Question:
    """The question about a plant at `start`; with `tied` its parameters stay near there."""
    constants = tempered_constants(shipped(), free=tied is None, channels=evidence.recorded)
    model = free_model(plant, start)
    return Question(
        evidence=evidence,
        held_out=held_out,
        model=model if tied is None else with_tempered_prior(model, evidence, constants),
        tied=tied,
        effects=tuple(effects),
        responses=responses,
        changes=changes,
        say=say,
        constants=constants,
    )


def tempered_constants(c: Constants, *, free: bool, channels: int = CHANNELS) -> Constants:
    """The constants for runs with so many `channels`, which together count as much as ten.

    Where parameters are `free` in every rival, a simulator with other values of them lacks nothing,
    and has the prior of nothing."""
    parameters = c.nothing if free else c.parameters
    return msgspec.structs.replace(
        c, evidence=c.evidence * CHANNELS / channels, parameters=parameters
    )


def free_model(plant: PlacesPlant, start: ModelPoint) -> Model:
    """A model whose parameters have the plant's priors around a point."""
    return Model(plant=plant, start=start, parameter_precision=np.eye(len(plant.parameters)))


def with_tempered_prior(model: Model, evidence: Evidence, constants: Constants) -> Model:
    """The model with its prior weighted as the tempered score weighs it against the rows."""
    return replace(model, prior_weight=max(evidence.independent_rows / constants.evidence, 1.0))


def day_variance(plant: PlantModel) -> Array:
    """Variance of each parameter from day to day, in prior deviations, (p,)."""
    day = traits_of(plant).day
    return np.array([max(day.get(q.name, 0.0), DAY) ** 2 for q in plant.parameters])


def cannot_replay(question: Question) -> GapError:
    """The error of a model that gives no numbers for some of the runs."""
    held_out = question.held_out.played if question.held_out else []
    return GapError(
        "the model cannot replay these runs",
        value=", ".join(p.whole.name for p in (*question.evidence.played, *held_out)),
        action="leave them out, or correct the model where it stops",
    )
