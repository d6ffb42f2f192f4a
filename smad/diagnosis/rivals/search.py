"""The search: in each step rivals are fitted by replay and compared, and one part may enter.

The rivals of a step are: nothing more, an effect of the library, a law at a place. Each is fitted
together with the parameters and the parts that have entered, and scored on rows that it was not
fitted to. If something is more likely missing than not, the likeliest enters that has a better
score, or likelier parameters. Then each earlier part may be exchanged for a better one, the others
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from smad.diagnosis.constants import shipped
from smad.diagnosis.places.responses import Responses, responses
from smad.diagnosis.rivals.changes import Change, changes_at
from smad.diagnosis.rivals.competing import (
    POLISHED,
    WITHIN,
    CompetingFits,
    earlier_starts,
    halfway_starts,
)
from smad.diagnosis.rivals.fit import Fit, Reference, fit, reference_at, reference_of
from smad.diagnosis.rivals.laws import selected_laws
from smad.diagnosis.rivals.parts import LawPart, Part
from smad.diagnosis.rivals.rival import Question, Rival, cannot_replay
from smad.diagnosis.rivals.score import EFFECT, LAW, NOTHING, PARAMETERS
from smad.diagnosis.rivals.screening import Screened, best_starts, screen

MOST_CAUSES = 3
"""Parts of an answer at most: of two changes both are found in a third of cases (decision 0720)."""
_LAWS = 4
"""Number of places whose law is fitted."""
_LIKELIER = 0.5
"""A part enters if something is missing with more than this probability."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One step: its rivals by probability, and what entered (None: nothing more)."""

    rivals: tuple[Rival, ...]
    entered: Rival | None


def run_search(
    question: Question, *, most: int = MOST_CAUSES, exchange: bool = True, laws: bool = True
) -> Search:
    """Take steps until nothing enters, all is at the floor, or `most` parts have entered.

    `exchange`: after each step earlier parts may be exchanged. `laws`: parts may be laws. Raises
    GapError where the model cannot replay the runs.
    """
    search = Search.start(question, exchange, laws)
    done = False
    while not done and len(search.parts) < most:
        done = search.step().entered is None or question.at_floor(search.final)
    search.nest()
    if not search.parts and not search.moved:
        search.final = search.configured
    search.compare_with_parameters()
    return search


@dataclass(kw_only=True, eq=False)
class Search:
    """The state of a search, and its result.

    `configured` is the simulator as it was, `parameters` with fitted parameters and no part,
    `final` with everything that entered. `moved`: fitted parameters have entered; they are free
    from then on and tied before. `changes` by effects are at the `nominal` simulator; `responses`
    of laws are computed when first needed. `free` is `final` with free parameters, once fitted.
    `imitated_effects` are the best effects of the step in which fitted parameters entered;
    `withdrawn` are parts that leave more than parameters alone.
    """

    question: Question
    nominal: Reference
    changes: tuple[Change, ...]
    configured: Rival
    parameters: Rival
    steps: list[Step]
    final: Rival
    moved: bool
    responses: Responses | None
    exchange: bool
    laws: bool
    free: Rival | None = None
    imitated_effects: tuple[Rival, ...] = ()
    withdrawn: tuple[Part, ...] = ()

    @classmethod
    def start(cls, question: Question, exchange: bool, laws: bool) -> Search:
        """A search before its first step: the parameters are fitted. Raises GapError."""
        e, free = question.evidence, question.model
        tied = free if question.tied is None else replace(free, parameter_precision=question.tied)
        zero = np.zeros(free.parameters)
        question.say("parameters")
        nominal = reference_at(e, tied, zero)
        if nominal is None:
            raise cannot_replay(question)
        configured = question.of_point(tied.start)
        parameters = question.converged(PARAMETERS, PARAMETERS, replace(nominal, model=free))
        current = parameters
        if question.tied is not None:
            current = question.converged(NOTHING, NOTHING, nominal, near=True)
        if configured is None or parameters is None or current is None:
            raise cannot_replay(question)
        changes = question.changes
        if changes is None:
            question.say("what each effect changes")
            changes = changes_at(free.plant, free.start, e.played, question.effects)
        return cls(
            question=question,
            nominal=nominal,
            configured=configured,
            changes=changes.rows(e, question.effects),
            parameters=parameters,
            steps=[],
            final=current,
            moved=question.tied is None,
            responses=question.responses,
            exchange=exchange,
            laws=laws,
        )

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts that have entered."""
        return self.final.parts

    def step(self) -> Step:
        """Fit and compare the rivals beside `final`; the likeliest may enter."""
        question, first = self.question, not self.steps
        same: list[Rival] = [replace(self.final, kind=NOTHING)]
        if first and self.moved:
            same = [self.configured, self.parameters]
        elif not self.moved and (free := self._with_free_parameters()) is not None:
            same.append(free)
        rivals = [*same, *self._rivals(self.final)]
        ranked, entered = self._compare(rivals)
        if entered is not None and entered.has_part:
            ended = [self._refit_without_part(rival, entered) for rival in same]
            ranked, entered = self._compare([*ended, *rivals[len(same) :]])
        if first and self.moved and entered is None:
            # Fitted parameters are always at least as likely as those configured: they are reported
            # where those configured are no longer credible.
            configured = sum(r.probability for r in ranked if r.kind == NOTHING)
            credible = configured > 1.0 - shipped().credible_level
            self.moved = not (credible or question.at_floor(self.configured))
        if entered is not None:
            self.moved |= entered.kind == PARAMETERS
            effects = sorted((r for r in ranked if r.kind == EFFECT), key=question.log_weight)
            self.imitated_effects = tuple(effects[-POLISHED:]) if entered.kind == PARAMETERS else ()
            self.final = self._exchange_parts(entered) if self.exchange else entered
            self.free = None
            self._include_form_error()
        self.steps.append(Step(rivals=tuple(ranked), entered=entered))
        return self.steps[-1]

    def _include_form_error(self) -> None:
        """Include the form error of the parts in the question, if parameters were tied."""
        if self.question.tied is not None and self.parts:
            fitted = self.final.fitted
            self.question = self.question.with_form_of(fitted)
            again = self.question.rival(self.final.kind, self.final.name, fitted)
            self.final = again or self.final

    def _compare(self, rivals: Sequence[Rival]) -> tuple[list[Rival], Rival | None]:
        """Rivals with their probabilities, the likeliest first, and which enters.

        Where good runs tie the parameters, the simulator may be as it was. If it surely lacks
        something, and yet nothing enters, the rivals are compared once more, given that it does.
        """
        question, by_rows = self.question, not self.steps or bool(self.question.form_sd)
        incomplete = question.incomplete(rivals)
        missing = incomplete and question.tied is None
        ranked = question.ranked(rivals, by_rows=by_rows, missing=missing)
        entered = self._choose(ranked, missing=missing)
        if entered is None and incomplete and not missing:
            given_missing = question.ranked(rivals, missing=True)
            entered = self._choose(given_missing, missing=True)
            ranked = given_missing if entered else ranked
        return ranked, entered

    def _choose(self, ranked: Sequence[Rival], *, missing: bool) -> Rival | None:
        """The rival that enters if something is missing: the likeliest better than `final`.

        The score decides, since in the gap over all signals the loudest one would; with a worse
        score a rival may be better by the prior of its parameters. If parts have entered and good
        runs tie the parameters, the gap must shrink, too. If something is surely `missing`, several
        things may be, which share the probability: then a rival need only be likelier than nothing
        more.
        """
        question, tied = self.question, self.question.tied is not None
        same, more = ([r for r in ranked if r.has_part == with_part] for with_part in (False, True))
        score, log_weight = self.final.scores.sum(), question.log_weight(self.final)
        nearer = [
            r
            for r in more
            if r.probability > 0.0
            and (r.scores.sum() > score or question.log_weight(r) > log_weight)
        ]
        if self.parts and tied:
            gap = question.gap(self.final)
            more = nearer = [r for r in nearer if question.gap(r) < gap]
        likelier = sum(r.probability for r in more) > _LIKELIER and not (missing and tied)
        if nearer and (likelier or (missing and nearer[0].probability > same[0].probability)):
            return _effect_in_place_of_law(nearer)
        return same[0] if same[0].kind == PARAMETERS and not self.moved else None

    def _refit_without_part(self, rival: Rival, beside: Rival) -> Rival:
        """A rival without the part of `beside`, fitted once more from the coordinates that they
        share, and from its own minimum if F there is little larger; the rival itself if F falls no
        further.

        The gain of a part counts only against a fit without it that has converged.
        """
        fitted = rival.fit
        if fitted is None:
            return rival
        # Until a part has entered, free parameters may still be far from the minimum.
        near = self.question.tied is not None or bool(self.parts)
        starts = [(beside.fitted.x[: len(fitted.x)], near)]
        if fitted.objective < beside.fitted.objective + WITHIN:
            starts.append((fitted.x, True))
        best, least_objective = rival, fitted.objective
        for x, near in starts:
            base = reference_of(
                self.question.evidence, replace(fitted, x=x, slopes=fitted.slopes[:0])
            )
            refitted = base and self.question.converged(rival.kind, rival.name, base, near=near)
            if refitted and refitted.fitted.objective < least_objective:
                best, least_objective = refitted, refitted.fitted.objective
        if rival.fit is self.parameters.fit:
            self.parameters = best
        if rival is self.free:
            self.free = best
        if rival.fit is self.final.fit:
            self.final = replace(best, kind=self.final.kind, name=self.final.name)
        return best

    def _with_free_parameters(self) -> Rival | None:
        """The parts that have entered, fitted again with free parameters."""
        if not self.parts:
            return self.parameters
        fitted = self.final.fitted
        if self.free is None and (base := reference_of(self.question.evidence, fitted)):
            precision = self.question.model.parameter_precision
            free = replace(fitted.model, parameter_precision=precision)
            self.free = self.question.converged(PARAMETERS, PARAMETERS, replace(base, model=free))
        return self.free

    def _exchange_parts(self, current: Rival) -> Rival:
        """The model with each part before its last exchanged for a better one, the others kept."""
        question = self.question
        count = len(current.parts)
        for i in range(count - 1):
            if question.at_floor(current):
                break
            fitted = current.fitted
            part, name = fitted.model.parts[i], fitted.model.parts[i].name
            others = [k for k in range(count) if k != i]
            without = self._refitted(fitted, others)
            base = None if without is None else reference_of(question.evidence, without)
            if without is None or base is None:
                continue
            candidates = self._screen(base)
            gain = max((s.gain for s in candidates if s.part.name == name), default=0.0)
            if not part.has_strength:
                # What is there or not promises nothing in a linear picture, but has been fitted.
                gain = without.objective - fitted.objective
            fits = CompetingFits(question, EFFECT, without=np.inf)
            better = [s for s in candidates if s.gain > gain]
            for effect, start in best_starts(question.evidence, base, better):
                fits.begin(base, effect, start)
            # The part that is asked is the last one of each rival.
            incumbent = replace(current, kind=EFFECT, name=name, fit=fitted.of_parts([*others, i]))
            ranked = question.ranked([incumbent, *fits.rivals()])
            best = ranked[0]
            if best.name != name and question.gap(best) < question.gap(current):
                order = [*range(i), count - 1, *range(i, count - 1)]
                current = replace(best, fit=best.fitted.of_parts(order))
                # The rank of what it replaces is that of an effect; a law stays one in the table.
                kind = LAW if isinstance(part, LawPart) else EFFECT
                rivals = tuple(replace(r, kind=kind) if r.name == name else r for r in ranked)
                k, _ = self.entered_parts()[i]
                self.steps[k] = Step(rivals=rivals, entered=best)
        return current

    def entered_parts(self) -> list[tuple[int, Rival]]:
        """The number of each step by which a part entered, and the rival that brought it."""
        entered = ((k, step.entered) for k, step in enumerate(self.steps))
        return [(k, rival) for k, rival in entered if rival is not None and rival.has_part]

    def nest(self) -> None:
        """Fit the parts of each step but the last again, where an exchange has changed them: every
        step then enters the first parts of the final model."""
        names = [part.name for part in self.parts]
        for count, (k, entered) in enumerate(self.entered_parts()[:-1], start=1):
            if [p.name for p in entered.parts] == names[:count]:
                continue
            first_parts = self.final.fitted.of_parts(range(count))
            base = reference_of(self.question.evidence, first_parts)
            refitted = base and self.question.converged(entered.kind, entered.name, base, near=True)
            self.steps[k] = replace(self.steps[k], entered=refitted or entered)

    def compare_with_parameters(self) -> None:
        """Withdraw parts that leave a larger gap than other parameters alone.

        Unless both together are likelier than parameters alone, and leave no larger gap.
        """
        question, alone = self.question, self.parameters
        worse = question.gap(self.final) > question.gap(alone)
        if not self.parts or not worse or question.at_floor(self.final):
            return
        free = None if self.moved else self._with_free_parameters()
        self.moved = True
        # In the floors that both are compared in.
        again = alone.fit and question.rival(PARAMETERS, PARAMETERS, alone.fit)
        if free and again and question.gap(free) <= question.gap(alone):
            both = replace(free, kind=self.final.kind, name=self.final.name)
            if question.ranked([both, again])[0].has_part:
                self.final = both
                return
        self.final, self.withdrawn = alone, self.parts
        # Later rivals were fitted beside the parts that are withdrawn.
        first, _ = self.entered_parts()[0]
        self.steps[first:] = [replace(self.steps[first], entered=None)]

    def _refitted(self, fitted: Fit, order: Sequence[int]) -> Fit | None:
        """The model with only the parts in `order`, fitted again."""
        e, fewer = self.question.evidence, fitted.of_parts(order)
        # Slopes that were measured with all parts must not be reused by another fit.
        base = reference_of(e, replace(fewer, linearized_at=fitted.linearized_at))
        return fit(e, base.model, base.x, base) if base else None

    def _screen(self, reference: Reference) -> list[Screened]:
        """The most promising effects that a reference lacks, the best first."""
        present = {part.name for part in reference.model.parts}
        changes = [c for c in self.changes if c.effect.name not in present]
        return screen(self.question.evidence, reference, changes)

    def _rivals(self, current: Rival) -> list[Rival]:
        """Effects and laws beside the parts of a rival, each fitted and scored."""
        question, e = self.question, self.question.evidence
        # Many fits begin with these slopes.
        base = reference_at(e, current.fitted.model, current.fitted.x)
        if base is None:
            return []
        without = question.gap(current)
        fits = CompetingFits(question, EFFECT, without=without)
        references = [base]
        if self.moved and not self.parts:
            # Parameters that have moved to imitate an effect hide it.
            references.append(replace(self.nominal, model=base.model))
        for reference in references:
            for effect, start in best_starts(e, reference, self._screen(reference)):
                fits.begin(reference, effect, start)
        of_last_step = self.steps[-1].rivals if self.steps else ()
        for part, start in chain(
            halfway_starts(self.imitated_effects, base), earlier_starts(e, of_last_step, base)
        ):
            fits.begin(base, part, start)
        rivals = fits.rivals()
        best = max(rivals, key=lambda r: r.scores.sum(), default=None)
        if not self.laws or (best is not None and question.at_floor(best)):
            return rivals
        question.say("laws of the places")
        if self.responses is None:
            plant, point = base.model.plant, base.model.point(base.x)
            self.responses = responses(plant, point, e.played, progress=question.say)
        present = {part.name for part in base.model.parts}
        laws = CompetingFits(question, LAW, without, fits.least_objective)
        for law, start in selected_laws(e, base, self.responses)[:_LAWS]:
            if law.name not in present:
                laws.begin(base, law, np.r_[base.x, start])
        return rivals + laws.rivals()


def _effect_in_place_of_law(may_enter: Sequence[Rival]) -> Rival:
    """The first of rivals that may enter; of a law, the likeliest of these effects there whose
    score is as good.
    """
    first, *others = may_enter
    if first.kind != LAW:
        return first
    effects = (r for r in others if r.kind == EFFECT and set(r.places) & set(first.places))
    return next((r for r in effects if r.scores.sum() >= first.scores.sum()), first)
