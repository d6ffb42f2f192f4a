"""The search: rivals of each step, refitted by replay, compared by what they leave, exchanged.

A step asks what the simulator lacks beside the parts that it has already. The rivals are: nothing
more, an effect of the library, a law at a place. Each is fitted with the parameters and the parts
before, and scored on rows that it was not fitted to. The likeliest one enters if it is likelier
than nothing more and brings the judged runs nearer; then each part before is asked again with the
others kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.data.played import predictions
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Effect, ModelPoint
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import (
    Fit,
    Reference,
    fit,
    leave_out,
    polished,
    rebased,
    reference_at,
    replayed,
    weights,
)
from smad.diagnosis.rivals.laws import LawSpace
from smad.diagnosis.rivals.parts import Model, Part
from smad.diagnosis.rivals.score import (
    EFFECT,
    LAW,
    NOTHING,
    PARAMETERS,
    Temper,
    log_scores,
    probabilities,
)
from smad.diagnosis.rivals.screening import Change, Screened, changes_at, screened

Say = Callable[[str], None]
_SCREENED = 8
"""Effects of each reference that are fitted."""
_LAWS = 4
"""Places whose law is fitted."""
_KEPT = 1e8
"""Precision of parameters that stay where they are."""
_FIRST_ROUNDS = 4
_POLISHED, _WITHIN = 3, 60.0
"""Fits that go on to their end, and how much more than the best one they may leave to be worth it,
in units of F."""
NEAR = 1.3
"""A channel that leaves at most so many floors shows nothing more: floors are known to a third."""


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
    def places(self) -> tuple[str, ...]:
        """Where the part that is asked acts; empty for parameters and nothing."""
        if self.kind not in (EFFECT, LAW) or self.fit is None:
            return ()
        return self.fit.model.parts[-1].places


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """What is asked: evidence to fit, evidence held out or None, and the model that is fitted.

    `effects` may be told; `places` are how many places there are. `tied` (p, p) is the precision of
    the parameters until other values of them are the answer; None: they are free from the start.
    `responses` are those of laws where they are known. `tau` (channels,) are correlation times in
    rows.
    """

    evidence: Evidence
    held_out: Evidence | None
    model: Model
    tied: Array | None
    responses: Responses | None
    effects: tuple[Effect, ...]
    places: int
    temper: Temper
    tau: Array
    say: Say

    @property
    def judged(self) -> Evidence:
        """The runs that rivals are judged on."""
        return self.evidence if self.held_out is None else self.held_out

    def rival(self, kind: str, name: str, fitted: Fit) -> Rival | None:
        """A rival by what it leaves of the judged runs; None where it cannot run there."""
        squares = self._squares(fitted)
        if squares is None:
            return None
        scores = log_scores(squares, self.judged.counts)
        return Rival(kind=kind, name=name, fit=fitted, squares=squares, scores=scores,
                     log_prior=fitted.model.log_prior(fitted.x))  # fmt: skip

    def fitted(self, kind: str, name: str, reference: Reference) -> Rival | None:
        """The model of a reference fitted from there on to its end, as a rival."""
        made = fit(self.evidence, reference.model, reference.x, reference, tau=self.tau, fresh=True)
        if made is None:
            return None
        return self.rival(kind, name, polished(self.evidence, made, self.tau))

    def steadied(
        self, rival: Rival | None, kind: str, name: str, free: Fit, nominal: Reference
    ) -> Rival | None:
        """The rival, or the same with the parameters where they were, whichever is likelier.

        Few runs let free parameters follow noise.
        """
        model = free.model
        kept = model.with_precision(_KEPT * np.eye(model.parameters))
        start = free.x.copy()
        start[: model.parameters] = 0.0
        made = fit(self.evidence, kept, start, nominal, tau=self.tau)
        steady = made and self.rival(kind, name, made)
        if not steady or steady.fit is None:
            return rival
        steady = replace(steady, fit=replace(steady.fit, model=model))
        return steady if rival is None else max(steady, rival, key=self.log_weight)

    def of_point(self, point: ModelPoint) -> Rival | None:
        """A simulator that is not fitted, by what it leaves; None where it cannot run."""
        found = replayed(self.judged, point, self.model, exact=True)
        if found is None:
            return None
        squares = self.squares_of(self.judged, self.judged.left(found))
        scores = log_scores(squares, self.judged.counts)
        return Rival(kind=NOTHING, name=NOTHING, fit=None, squares=squares, scores=scores)

    def near(self, rival: Rival) -> bool:
        """Whether a rival leaves nothing that could be told in any channel of the judged runs."""
        counts = self.judged.counts.sum(axis=0)
        return bool((rival.squares.sum(axis=0) <= NEAR**2 * counts).all())

    def gap(self, rival: Rival) -> float:
        """What a rival leaves of the judged runs, root mean square in floors."""
        return float(np.sqrt(rival.squares.sum() / max(self.judged.counts.sum(), 1.0)))

    def ranked(self, rivals: Sequence[Rival]) -> list[Rival]:
        """Rivals with their probabilities, the likeliest first."""
        p = probabilities(
            np.array([r.scores for r in rivals]), [r.kind for r in rivals], self.temper,
            effects=len(self.effects), laws=self.places,
            log_prior=np.array([r.log_prior for r in rivals]),
        )  # fmt: skip
        made = [replace(r, probability=float(x)) for r, x in zip(rivals, p, strict=True)]
        return sorted(made, key=lambda r: -r.probability)

    def log_weight(self, rival: Rival) -> float:
        """Log of a rival's unnormalised probability, but for what all of its kind share."""
        return float(0.5 * self.temper.evidence * rival.scores.sum() + rival.log_prior)

    def squares_of(self, evidence: Evidence, left: Array) -> Array:
        """Squares by run and channel of rows, what wanders in each run taken off."""
        return evidence.squares(evidence.freed(left, weights(evidence, left, self.tau)))

    def predicted(self, fitted: Fit) -> list[Array] | None:
        """What a fit predicts of the judged runs, (bins, channels) each, without a part in them.

        Without runs held out each fold is predicted by coordinates fitted to the others. None where
        the model cannot run.
        """
        if self.held_out is not None:
            return replayed(self.held_out, fitted.point, fitted.model, exact=True)
        evidence = self.evidence
        out = [np.zeros_like(t.target) for t in evidence.trials]
        for f, x in enumerate(leave_out(evidence, fitted, self.tau)):
            point = fitted.model.point(x)
            for k in np.unique(evidence.run_of_row[evidence.fold == f]):
                (found,) = predictions(fitted.model.plant, point, [evidence.played[k]], exact=True)
                if not np.isfinite(found).all():
                    return None
                fold = evidence.fold[evidence.run_of_row == k].reshape(found.shape)
                # A row that does not count has no fold; any prediction may stand there.
                out[k] = np.where((fold == f) | (fold < 0), found, out[k])
        return out

    def _squares(self, fitted: Fit) -> Array | None:
        found = self.predicted(fitted)
        return None if found is None else self.squares_of(self.judged, self.judged.left(found))


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One step: its rivals by probability, and what entered (None: nothing more)."""

    rivals: tuple[Rival, ...]
    entered: Rival | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Searched:
    """What a search gave.

    `configured` is the simulator as it was, `parameters` with other values of them and no part,
    `final` with everything that entered. `moved`: other values of the parameters are among that.
    `changes` are what each effect changes at the `nominal` simulator.
    """

    question: Question
    nominal: Reference
    changes: tuple[Change, ...]
    configured: Rival
    parameters: Rival
    steps: tuple[Step, ...]
    final: Rival
    moved: bool


def searched(question: Question, *, most: int, exchange: bool = True) -> Searched | None:
    """Ask step by step, until nothing more is likeliest, or for `most` parts.

    `exchange`: after each step every part before is asked again. None where the model cannot replay
    the runs.
    """
    search = _Search.begun(question)
    if search is None:
        return None
    search.exchange = exchange
    configured, parameters = search.configured, search.parameters
    steps: list[Step] = []
    done = False
    while not done and len(search.parts) < most:
        step = search.step(first=not steps)
        steps.append(step)
        done = step.entered is None or question.near(search.current)
    if not search.parts and not search.moved:
        search.current = configured
    if question.gap(search.current) > question.gap(parameters) and search.parts:
        # What leaves more of the judged runs than parameters alone is not told, whatever it is.
        search.current, search.moved = parameters, True
    return Searched(
        question=question, nominal=search.nominal, changes=search.changes, configured=configured,
        parameters=parameters, steps=tuple(steps), final=search.current, moved=search.moved,
    )  # fmt: skip


@dataclass(kw_only=True, eq=False)
class _Search:
    """The state of a search: what has entered so far.

    `current` has all of it; `moved` says whether the parameters are free, or tied to where they
    were. Responses of laws are made once, where they are first asked for.
    """

    question: Question
    nominal: Reference
    changes: tuple[Change, ...]
    configured: Rival
    parameters: Rival
    current: Rival
    moved: bool
    responses: Responses | None
    exchange: bool = True

    @classmethod
    def begun(cls, question: Question) -> _Search | None:
        """The simulator as configured and with fitted parameters; None where it cannot run."""
        e, free = question.evidence, question.model
        tied = free if question.tied is None else free.with_precision(question.tied)
        zero = np.zeros(free.parameters)
        question.say("parameters")
        nominal = reference_at(e, tied, zero)
        if nominal is None:
            return None
        configured = question.of_point(tied.start)
        parameters = question.fitted(PARAMETERS, PARAMETERS, replace(nominal, model=free))
        current = parameters
        if question.tied is not None:
            current = question.fitted(NOTHING, NOTHING, nominal)
            if current is not None and current.fit is not None:
                current = question.steadied(current, NOTHING, NOTHING, current.fit, nominal)
        if configured is None or parameters is None or current is None:
            return None
        question.say("screening the effects")
        return cls(question=question, nominal=nominal, configured=configured,
                   changes=changes_at(e, nominal, [x for x in question.effects if x.parameters]),
                   parameters=parameters, current=current, moved=question.tied is None,
                   responses=question.responses)  # fmt: skip

    @property
    def parts(self) -> tuple[Part, ...]:
        """What has entered."""
        return self.current.fit.model.parts if self.current.fit is not None else ()

    def step(self, *, first: bool) -> Step:
        """Ask what more there is; what is likeliest enters."""
        question = self.question
        same: list[Rival] = [replace(self.current, kind=NOTHING)]
        if first and self.moved:
            same = [self.configured, self.parameters]
        elif not self.moved and (free := self._freed()) is not None:
            same.append(free)
        ranked = question.ranked([*same, *self._rivals(self.current, first=first)])
        gap = question.gap(self.current)
        entered = None
        for best in ranked:
            if best.kind == NOTHING or (best.kind == PARAMETERS and self.moved):
                break
            if best.kind == PARAMETERS or question.gap(best) < gap:
                entered = best
                break
        if first and self.moved and entered is None and ranked[0].kind == NOTHING:
            self.moved = False
        if entered is not None:
            self.moved |= entered.kind == PARAMETERS
            self.current = self._exchanged(entered) if self.exchange else entered
        return Step(rivals=tuple(ranked), entered=entered)

    def _freed(self) -> Rival | None:
        """What has entered so far, with free parameters."""
        fitted = self.current.fit
        if fitted is None or not self.parts:
            return self.parameters
        here = rebased(self.question.evidence, fitted)
        free = fitted.model.with_precision(self.question.model.parameter_precision)
        if here is None:
            return None
        return self.question.fitted(PARAMETERS, PARAMETERS, replace(here, model=free))

    def _exchanged(self, current: Rival) -> Rival:
        """The model with each part before its last asked again, the others kept."""
        question = self.question
        count = len(current.fit.model.parts) if current.fit is not None else 0
        for i in range(count - 1):
            fitted = current.fit
            if fitted is None or question.near(current):
                break
            name = fitted.model.parts[i].name
            base = self._without(fitted, i)
            if base is None:
                continue
            asked = self._screened(base)
            gain = max((s.gain for s in asked if s.part.name == name), default=0.0)
            fits = _Fits(question, self.nominal)
            for s in [s for s in asked if s.gain > gain][:_SCREENED]:
                fits.begin(EFFECT, s.reference, s.part, s.coordinates)
            ranked = question.ranked([replace(current, kind=EFFECT, name=name), *fits.rivals()])
            if ranked[0].name != name and question.gap(ranked[0]) < question.gap(current):
                current = ranked[0]
        return current

    def _without(self, fitted: Fit, i: int) -> Reference | None:
        """The model without one of its parts, fitted anew."""
        e, model = self.question.evidence, fitted.model
        kept = [k for k in range(len(model.parts)) if k != i]
        x = np.concatenate([
            fitted.x[: model.parameters], *(fitted.x[model.slices[k]] for k in kept)
        ])  # fmt: skip
        smaller = model.with_parts([model.parts[k] for k in kept])
        here = rebased(e, replace(fitted, model=smaller, x=x))
        made = here and fit(e, smaller, x, here, tau=self.question.tau)
        return rebased(e, made) if made else None

    def _screened(self, reference: Reference) -> list[Screened]:
        """The effects that a reference does not have, the most promising first."""
        present = {part.name for part in reference.model.parts}
        changes = [c for c in self.changes if c.effect.name not in present]
        return screened(self.question.evidence, reference, changes, self.question.tau)

    def _rivals(self, current: Rival, *, first: bool) -> list[Rival]:
        """Effects and laws beside what a model has, each fitted and scored."""
        question, e = self.question, self.question.evidence
        here = None if current.fit is None else rebased(e, current.fit)
        if here is None:
            return []
        fits = _Fits(question, self.nominal)
        references = [here]
        if first and question.tied is None:
            # Where the parameters have moved to imitate an effect it is hidden.
            references.append(replace(self.nominal, model=here.model))
        for reference in references:
            for s in self._screened(reference)[:_SCREENED]:
                fits.begin(EFFECT, reference, s.part, s.coordinates)
        rivals = fits.rivals()
        best = max(rivals, key=lambda r: r.scores.sum(), default=None)
        if best is not None and question.near(best):
            return rivals
        question.say("laws of the places")
        space = LawSpace.at(e, here, question.tau, self.responses, question.say)
        self.responses = space.responses
        present = {part.name for part in here.model.parts}
        laws = _Fits(question, self.nominal, least=fits.least)
        for law in space.selected()[:_LAWS]:
            if law.part.name not in present:
                laws.begin(LAW, here, law.part, law.coordinates)
        return rivals + laws.rivals()


class _Fits:
    """Fits that compete: a few rounds for all, the best go on to their end.

    `least` is the least F of a fit so far.
    """

    def __init__(self, question: Question, nominal: Reference, least: float = float("inf")) -> None:
        self.least = least
        self._question, self._nominal = question, nominal
        self._found: dict[str, tuple[str, Fit]] = {}

    def begin(self, kind: str, reference: Reference, part: Part, coordinates: Array) -> None:
        """A few rounds of a part beside a reference; the better of two of one name stays."""
        question = self._question
        question.say(f"fitting {part.name}")
        model = reference.model.with_parts([*reference.model.parts, part])
        start = np.r_[reference.x, coordinates]
        made = fit(question.evidence, model, start, reference, tau=question.tau,
                   rounds=_FIRST_ROUNDS)  # fmt: skip
        known = self._found.get(part.name)
        if made and (known is None or made.objective < known[1].objective):
            self._found[part.name] = kind, made
            self.least = min(self.least, made.objective)

    def rivals(self) -> list[Rival]:
        """The fits as rivals."""
        question = self._question
        fits = {name: made for name, (_, made) in self._found.items()}
        near = []
        for name in _best(fits)[:_POLISHED]:
            if fits[name].objective < self.least + _WITHIN:
                near.append(name)
                # Parameters that are tied stay where their slopes hold.
                fits[name] = polished(question.evidence, fits[name], question.tau,
                                      moved=question.tied is None)  # fmt: skip
                self.least = min(self.least, fits[name].objective)
        kinds = {name: kind for name, (kind, _) in self._found.items()}
        scored = {name: question.rival(kinds[name], name, f) for name, f in fits.items()}
        for name in near:
            scored[name] = question.steadied(scored[name], kinds[name], name, fits[name],
                                             self._nominal)  # fmt: skip
        return [r for r in scored.values() if r is not None]


def _best(fits: dict[str, Fit]) -> list[str]:
    return sorted(fits, key=lambda name: (fits[name].objective, name))
