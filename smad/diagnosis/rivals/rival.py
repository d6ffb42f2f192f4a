"""A rival, and the question that it answers: what is fitted, and what it is judged on.

A rival is judged by what it leaves of rows that it was not fitted to, runs held out or else each
fold in turn, replayed as they were recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np

from smad.counted import counted
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.data.played import predictions
from smad.diagnosis.errors import GapError
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Array, Effect, ModelPoint, PlantModel, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence, form_of, without_drifts
from smad.diagnosis.rivals.fit import (
    Fit,
    Reference,
    fit,
    fit_to_end,
    leave_out,
    rebased,
    replayed,
)
from smad.diagnosis.rivals.parts import Model
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

_STEP_SHARES = (1.0, 0.5, 0.25)
"""Shares of the step to where a run is left out, the longest first."""
_ROUGH = 0.3
"""Floors by which a replay may differ from what slopes predict: it is rough where springs turn."""
CHANNELS = 10
"""Of the spring pair, on which κ was fitted."""
DAY = 0.05
"""How far a parameter may be from where good runs have it, in prior standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Predicted:
    """A prediction of all judged runs, (bins, channels) each, and the rows (n,) judged by it."""

    values: Sequence[Array]
    rows: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Rival:
    """A hypothesis with its fit (None for the simulator as configured), and what it leaves.

    `squares` (judged runs, channels) are in floors, of rows that it was not fitted to; `scores`
    (judged runs,) are those of `log_scores`. `log_prior` is that of where its parameters are.
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
    def places(self) -> tuple[str, ...]:
        """Where the part that is asked acts; empty for parameters and nothing."""
        if not self.has_part or self.fit is None:
            return ()
        return self.fit.model.parts[-1].places


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """What is asked: evidence to fit, evidence held out or None, and the model that is fitted.

    `effects` may be told. `temper` weighs rivals, by the channels that these runs have. `tied`
    (p, p) is the precision of the parameters until other values of them are the answer; None: they
    are free from the start.
    `responses` are those of laws, and `changes` those of effects, where they are known.
    `form_share` is the largest share of a floor's square that the model's form makes, and `good`
    how many runs say so. `form` (bins, channels) of each judged run is how well the form of what
    has entered is known, one standard deviation in channel units; empty before.
    """

    evidence: Evidence
    held_out: Evidence | None
    model: Model
    tied: Array | None
    responses: Responses | None
    changes: Changes | None
    effects: tuple[Effect, ...]
    temper: Constants
    say: Say
    form_share: float = 0.0
    good: int = 0
    form: tuple[Array, ...] = ()

    @property
    def judged(self) -> Evidence:
        """The runs that rivals are judged on."""
        return self.evidence if self.held_out is None else self.held_out

    @property
    def judged_on(self) -> str:
        """The same in words."""
        count = len(self.judged.trials)
        if self.held_out is not None:
            return f"{counted(count, 'run')} held out"
        runs = "the one run" if count == 1 else f"{count} runs"
        stretches = "" if self.evidence.by_runs else "stretches of "
        return f"{stretches}{runs}, each by a model fitted to the others"

    @cached_property
    def scored(self) -> Evidence:
        """The judged runs in floors that hold the `form` of what has entered, where it has one."""
        pairs = zip(self.judged.trials, self.form, strict=True)
        return replace(self.judged, trials=tuple(t.less_known(form) for t, form in pairs))

    def after(self, fitted: Fit) -> Question:
        """The same once the parts of a fit have entered: what these leave says how well their form
        is known. As it is where the model cannot run."""
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
        return replace(self, form=form_of(e, put_together(e, predicted), moved))

    def rival(self, kind: str, name: str, fitted: Fit) -> Rival | None:
        """A rival by what it leaves of the judged runs; None where it cannot run there."""
        predicted = self.predicted(fitted)
        if predicted is None:
            return None
        rival = self._leaving(predicted, kind, name, fitted)
        return replace(rival, log_prior=fitted.model.log_prior(fitted.x))

    def fitted(
        self, kind: str, name: str, reference: Reference, *, near: bool = False
    ) -> Rival | None:
        """The model of a reference fitted from there on to its end, as a rival.

        `near`: it is not far from there.
        """
        fitted = fit_to_end(self.evidence, reference, near=near)
        return None if fitted is None else self.rival(kind, name, fitted)

    def steadied(self, kind: str, name: str, free: Fit) -> Rival | None:
        """A fit with free parameters carried on with the prior that the score prefers, as a rival;
        None where it cannot run.

        Few runs let free parameters follow noise, and where every row counts they go further from
        the prior than a tempered score rewards.
        """
        reference = rebased(self.evidence, free)
        model = tempered(free.model, self.evidence, self.temper)
        fitted = reference and fit(self.evidence, model, free.x, reference)
        steady = fitted and self.rival(kind, name, fitted)
        if not steady or steady.fit is None:
            return None
        return replace(steady, fit=replace(steady.fit, model=free.model))

    def of_point(self, point: ModelPoint) -> Rival | None:
        """A simulator that is not fitted, by what it leaves; None where it cannot run."""
        predicted = replayed(self.judged, point, self.model, exact=True)
        if predicted is None:
            return None
        return self._leaving([_of_all_rows(self.judged, predicted)], NOTHING, NOTHING, None)

    def _leaving(
        self, predicted: Sequence[Predicted], kind: str, name: str, fitted: Fit | None
    ) -> Rival:
        """A rival by its prediction of the judged runs; what wanders in each is taken off."""
        squares = _squares(self.judged, predicted)
        scored = _squares(self.scored, predicted) if self.form else squares
        scores = log_scores(scored, self.judged.counts, self.judged.least)
        return Rival(kind=kind, name=name, fit=fitted, squares=squares, scores=scores)

    def point_of(self, rival: Rival) -> ModelPoint:
        """The simulator of a rival."""
        return self.model.start if rival.fit is None else rival.fit.point

    def near(self, rival: Rival) -> bool:
        """Whether a rival leaves nothing that could be told in any channel of the judged runs."""
        counts = self.judged.counts.sum(axis=0)
        return bool((rival.squares.sum(axis=0) <= AT_FLOOR**2 * counts).all())

    def gap(self, rival: Rival) -> float:
        """What a rival leaves of the judged runs, root mean square in floors."""
        return float(np.sqrt(rival.squares.sum() / max(self.judged.counts.sum(), 1.0)))

    @property
    def independent_rows(self) -> float:
        """Rows of a judged run and channel that count as independent of each other, on average."""
        counts = self.judged.counts
        rows = float((counts / CORRELATED)[counts > 0].mean())
        return effective_rows(rows, self.form_share, shipped().evidence, self.good)

    @property
    def quiet_gap(self) -> float:
        """Floors over all signals that nothing new leaves at most."""
        return quiet_gap(self.form_share, shipped().evidence, self.good)

    def refuted(self, rivals: Sequence[Rival]) -> list[bool]:
        """Which rivals leave more than nothing new leaves, as long as another one does not.

        Where floors hold an error of form κ is too soft to refute a simulator by its score. Else a
        part may be nearly right, and so may a simulator that a part has entered.
        """
        above = [self.gap(r) > self.quiet_gap for r in rivals]
        if all(above) or self.form:
            return [False] * len(above)
        return [
            too_much and (bool(self.form_share) or not r.has_part)
            for too_much, r in zip(above, rivals, strict=True)
        ]

    def incomplete(self, rivals: Sequence[Rival]) -> bool:
        """Whether a simulator whose parameters are free leaves more than noise without a part more.

        Then it surely lacks something: what is asked is whether a rival describes it.
        """
        same = (r for r in rivals if not r.has_part)
        return self.tied is None and all(self.gap(r) > self.quiet_gap for r in same)

    def ranked(self, rivals: Sequence[Rival], *, by_rows: bool = False) -> list[Rival]:
        """Rivals with their probabilities, the likeliest first.

        `by_rows`: every row counts against a simulator without a part more, since it may be right.
        """
        refuted = self.refuted(rivals)
        temper = self.temper.of_unknown if self.incomplete(rivals) else self.temper
        compared = [r for r, out in zip(rivals, refuted, strict=True) if not out]
        # Parameters that a prior holds back leave a little without being wrong in form.
        same = [r.fit.model for r in compared if r.fit and not r.has_part]
        formed = by_rows or any(model.parts for model in same)
        near = [formed and self.near(r) for r in compared]
        p = probabilities(
            self._compared(compared, near),
            [r.kind for r in compared],
            temper,
            effects=len(self.effects),
            laws=len(self.model.plant.places),
            log_prior=np.array([r.log_prior for r in compared]),
            rows=self.independent_rows,
            by_rows=by_rows,
            near=near,
        )
        ranked = [replace(r, probability=float(x)) for r, x in zip(compared, p, strict=True)]
        ranked += [
            replace(r, probability=0.0) for r, out in zip(rivals, refuted, strict=True) if out
        ]
        return sorted(ranked, key=lambda r: -r.probability)

    def _compared(self, rivals: Sequence[Rival], near: Sequence[bool]) -> Array:
        """Scores (rivals, runs), some of the rivals being `near` the floor.

        If parts alone leave nothing that could be told, the form of what has entered is right, and
        floors hold nothing of it.
        """
        have_part = {r.has_part for r, is_near in zip(rivals, near, strict=True) if is_near}
        e = self.judged
        if self.form and have_part == {True}:
            return np.array([log_scores(r.squares, e.counts, e.least) for r in rivals])
        return np.array([r.scores for r in rivals])

    def log_weight(self, rival: Rival) -> float:
        """What orders fits of one kind: score at κ for each run, and prior of the parameters."""
        return float(0.5 * self.temper.evidence * rival.scores.sum() + rival.log_prior)

    def predicted(self, fitted: Fit) -> list[Predicted] | None:
        """What a fit predicts of the judged runs without a part in them; None where it cannot run.

        Without runs held out each fold is predicted by coordinates fitted to the others, or to all
        where the model cannot run at those; replayed as in the fit. Of folds that are stretches
        each has a prediction of the whole runs: what wanders there is found with it, and would
        else follow the steps between the stretches.
        """
        if self.held_out is not None:
            held_out = replayed(self.held_out, fitted.point, fitted.model, exact=True)
            return None if held_out is None else [_of_all_rows(self.held_out, held_out)]
        evidence = self.evidence
        trials = range(len(evidence.trials))
        whole, out = [np.zeros_like(t.target) for t in evidence.trials], []
        for f, x in enumerate(leave_out(evidence, fitted)):
            rows = evidence.fold == f
            left_out = np.unique(evidence.run_of_row[rows]) if evidence.by_runs else trials
            for k in left_out:
                predicted = self._without(fitted, x - fitted.x, int(k))
                if predicted is None:
                    return None
                whole[k] = predicted
            out.append(Predicted(values=tuple(whole), rows=rows))
        return [_of_all_rows(evidence, whole)] if evidence.by_runs else out

    def _without(self, fitted: Fit, step: Array, k: int) -> Array | None:
        """What a fit predicts of run `k` at a `step` from its coordinates, (bins, channels).

        Slopes predict a change for the step. Where a replay differs from the prediction by more
        than that change, the step is shortened; where the model cannot run, it is not taken. None
        where the model cannot run without it either.
        """
        trial, span = self.evidence.trials[k], self.evidence.spans[k]
        exact, shift = fitted.shift is None, 0.0 if fitted.shift is None else fitted.shift[k]
        out = None
        for share in (*_STEP_SHARES, 0.0):
            point = fitted.model.point(fitted.x + share * step)
            (predicted,) = predictions(fitted.model.plant, point, [trial.played], exact=exact)
            if not np.isfinite(predicted).all():
                continue
            out = predicted + shift
            change = share * step @ fitted.slopes[:, span]
            off = trial.rows.independent((trial.target - out)[None])[0]
            off -= fitted.left[span] - change
            like = off @ off <= max(change @ change, _ROUGH**2 * len(off))
            if like or share == _STEP_SHARES[-1]:
                break
        return out


def _of_all_rows(evidence: Evidence, values: Sequence[Array]) -> Predicted:
    return Predicted(values=values, rows=np.ones(len(evidence.run_of_row), dtype=bool))


def put_together(evidence: Evidence, predicted: Sequence[Predicted]) -> list[Array]:
    """Of each row the prediction that it is judged by, (bins, channels) of each run."""
    out = list(predicted[0].values)
    for one in predicted[1:]:
        for k, span in enumerate(evidence.spans):
            out[k] = np.where(one.rows[span].reshape(out[k].shape), one.values[k], out[k])
    return out


def _squares(evidence: Evidence, predicted: Sequence[Predicted]) -> Array:
    """Squares that predictions leave, what wanders in each run taken off, (runs, channels)."""
    settled = (
        np.where(p.rows, without_drifts(evidence, evidence.left(p.values)), 0.0) for p in predicted
    )
    return evidence.squares(sum(settled, start=np.zeros(len(evidence.run_of_row))))


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
    """What is asked of a plant at `start`; with `tied` its parameters stay near there."""
    temper = temper_of(shipped(), free=tied is None, channels=evidence.recorded)
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


def temper_of(c: Constants, *, free: bool, channels: int = CHANNELS) -> Constants:
    """What weighs rivals. Where parameters are `free` in every rival, other values of them without
    a part are the simulator in which nothing is missing. Fewer `channels` say as much together."""
    parameters = c.nothing if free else c.parameters
    return msgspec.structs.replace(
        c, evidence=c.evidence * CHANNELS / channels, parameters=parameters
    )


def free_model(plant: PlacesPlant, start: ModelPoint) -> Model:
    """A model whose parameters have the plant's priors around a point."""
    return Model(plant=plant, start=start, parameter_precision=np.eye(len(plant.parameters)))


def tempered(model: Model, evidence: Evidence, temper: Constants) -> Model:
    """The model whose fit counts the prior as much more as a score counts fewer rows."""
    rows = float((evidence.counts / CORRELATED)[evidence.counts > 0].mean())
    return replace(model, rows_as_one=max(rows / temper.evidence, 1.0))


def day_variance(plant: PlantModel) -> Array:
    """Variance of each parameter from day to day, in prior deviations, (p,)."""
    day = traits_of(plant).day
    return np.array([max(day.get(q.name, 0.0), DAY) ** 2 for q in plant.parameters])


def cannot_replay(question: Question) -> GapError:
    """The model gives no numbers for the runs."""
    return GapError(
        "the model cannot replay these runs",
        value=", ".join(p.whole.name for p in question.evidence.played),
        action="leave them out, or correct the model where it stops",
    )
