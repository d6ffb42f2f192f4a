"""Forward and backward selection of effects, judged on runs and regimes left out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from smad.gap.compare.score_table import Place, ScoreTable
from smad.gap.fit.hypothesis import (
    Hypothesis,
    acceptable,
    asked_gain,
    cluster_gain,
    ending_at_bound,
    touched_outputs,
)
from smad.gap.fit.joint import JointFit, Start, joint_fits
from smad.gap.fit.judge import Judged, judge, regime_gains
from smad.gap.fit.lsq import FitResult, Problem
from smad.gap.fit.screen import Screened, probe, reprobe, screen
from smad.gap.plant import Effect
from smad.gap.settings import Settings

_SURVIVORS, _STARTS = 7, 2
"""Candidates that the first screening leaves, and starts of the joint fit of each."""


@dataclass(frozen=True)
class Selection:
    """The outcome: `base` (refit only), `best`, and what stood beside it.

    `steps` are the accepted models in order. `rivals` are, for each effect of `best`, the models
    with that effect replaced by another. `probability` is, for each effect of `best`, that of every
    effect in its place, "" being none. `screened` is the first screening.
    """

    base: Hypothesis
    best: Hypothesis
    steps: tuple[Hypothesis, ...]
    rivals: dict[str, tuple[Hypothesis, ...]]
    probability: dict[str, dict[str, float]]
    screened: tuple[Screened, ...]
    tried: tuple[Hypothesis, ...]

    @classmethod
    def without_effects(cls, refit: Hypothesis, asked: Selection) -> Selection:
        """Another refit, with nothing in it, as the answer to what `asked` has screened."""
        return cls(refit, refit, (), {}, {}, asked.screened, ())


class Selector:
    """Forward steps, swaps and backward steps over the effects of a library.

    `unscreened` effects are fitted and judged even where screening gains nothing by them.
    """

    def __init__(
        self,
        refit: FitResult,
        hold: Problem | None,
        effects: Sequence[Effect],
        progress: Callable[[str], None] = lambda text: None,
        *,
        is_new: Callable[[Hypothesis], bool] = lambda candidate: True,
        unscreened: Collection[str] = (),
    ) -> None:
        self.refit, self.hold, self.is_new = refit, hold, is_new
        self.unscreened = unscreened
        self.tied = refit.space.tie is not None
        # The order in which a library lists its effects must not matter.
        self.effects = tuple(sorted(effects, key=lambda e: e.name))
        self.settings: Settings = refit.problem.dataset.settings
        self.progress = progress
        # What is asked twice of the same fit, with the fit, so that its identity stays its own.
        self._refits: dict[tuple[int, tuple[str, ...]], tuple[FitResult, JointFit]] = {}
        self._less: dict[tuple[int, str], tuple[FitResult, Hypothesis]] = {}
        self._news: dict[int, tuple[FitResult, bool]] = {}

    def run(self) -> Selection:
        """The whole selection."""
        base = Hypothesis(JointFit(self.refit, ()), judge([self.refit], self.hold)[0])
        current = base
        steps: list[Hypothesis] = []
        tried: list[Hypothesis] = []
        first: list[Screened] = []
        while len(steps) < self.settings.max_effects:
            self.progress(f"screening for effect {len(steps) + 1}")
            ranked, candidates = self._level(current, first_level=not steps)
            first = first or ranked
            chosen = self._first(candidates)
            if chosen is not None:
                current, candidates = self._on_equal_terms(current, chosen, candidates)
                if steps:
                    steps[-1] = current
                else:
                    base = current
                chosen = self._first(candidates)
            tried += candidates
            if chosen is None:
                break
            steps.append(chosen)
            current = chosen
        best = self._backward(base, current) if len(steps) > 1 else current
        best, places = self._places(base, best, tried)
        rivals = {name: place.rivals for name, place in places.items()}
        probability = {
            name: ScoreTable.of(name, p, best).probability() for name, p in places.items()
        }
        if not places and tried:
            nothing = Place(base, tuple(tried[:4]))
            probability[""] = ScoreTable.of("", nothing, base).probability()
        return Selection(base, best, tuple(steps), rivals, probability, tuple(first), tuple(tried))

    def _level(
        self, current: Hypothesis, *, first_level: bool
    ) -> tuple[list[Screened], list[Hypothesis]]:
        if first_level:
            self._probes = probe(current.fit, self.effects)
        ranked = screen(reprobe(self._probes, current.fit)) if self.effects else []
        count = _SURVIVORS if first_level else max(3, _SURVIVORS - 3)
        survivors = short_list(ranked, count, self.unscreened)
        self.progress(f"fitting {len(survivors)} candidates")
        starts = []
        for s in survivors:
            sets = (*current.fit.space.effects, s.effect)
            before = dict(current.fit.point.effects)
            starts += [
                Start(sets, {**before, s.effect.name: values})
                for values in (s.start, s.second)[:_STARTS]
                if values is not None
            ]
            if first_level and not self.tied:
                starts.append(Start(sets, {s.effect.name: s.start}, from_centre=True))
        joints = joint_fits(current.fit, starts)
        return ranked, self._judged(current, list(joints.values()))

    def _judged(self, before: Hypothesis, joints: Sequence[JointFit]) -> list[Hypothesis]:
        """Candidates with their gains over `before`, best first."""
        judged = judge([j.fit for j in joints], self.hold)
        out = [weighed(before, j, v) for j, v in zip(joints, judged, strict=True)]
        return sorted(out, key=_best_first)

    def _first(self, candidates: Sequence[Hypothesis]) -> Hypothesis | None:
        return next((c for c in candidates if self._enters(c)), None)

    def _on_equal_terms(
        self, before: Hypothesis, chosen: Hypothesis, candidates: list[Hypothesis]
    ) -> tuple[Hypothesis, list[Hypothesis]]:
        """The model before, refitted from where a candidate has taken its parameters.

        A candidate's fit goes on where the other had ended. What it gains because the parameters
        have come to a better place is not its effect's: if the model before does better from there,
        too, that is what all candidates are compared with.
        """
        joint = self._refitted(chosen, before.fit.space.effects)
        if joint.fit.objective >= before.fit.objective:
            return before, candidates
        fairer = replace(before, joint=joint, judged=judge([joint.fit], self.hold)[0])
        again = [weighed(fairer, c.joint, c.judged) for c in candidates]
        return fairer, sorted(again, key=_best_first)

    def _enters(self, c: Hypothesis) -> bool:
        if not acceptable(c, self.settings, tied=self.tied):
            return False
        # What would have to be stronger than it can be is no further cause, and must not put an
        # earlier one in doubt. Alone it is: its neighbours would be named for it.
        if len(c.names) > 1 and c.names[-1] in ending_at_bound(c.fit):
            return False
        # However its gain is reckoned, its fit is judged as it was.
        known = self._news.get(id(c.fit))
        if known is None:
            known = self._news[id(c.fit)] = (c.fit, self.is_new(c))
        return known[1]

    def _refitted(self, current: Hypothesis, effects: tuple[Effect, ...]) -> JointFit:
        names = tuple(e.name for e in effects)
        known = self._refits.get((id(current.fit), names))
        if known is None:
            values = current.fit.point.effects
            start = Start(effects, {name: values[name] for name in names})
            joint = next(iter(joint_fits(current.fit, [start], finish=1).values()))
            known = self._refits[id(current.fit), names] = (current.fit, joint)
        return known[1]

    def _without(self, base: Hypothesis, current: Hypothesis, name: str) -> Hypothesis:
        """The model refitted without one of its effects; the same for whoever asks first."""
        known = self._less.get((id(current.fit), name))
        if known is None:
            keep = tuple(e for e in current.fit.space.effects if e.name != name)
            joint = self._refitted(current, keep)
            without = weighed(base, joint, judge([joint.fit], self.hold)[0])
            known = self._less[id(current.fit), name] = (current.fit, without)
        return known[1]

    def _backward(self, base: Hypothesis, current: Hypothesis) -> Hypothesis:
        """Drops effects that the others have made superfluous."""
        while len(current.names) > 1:
            smaller = []
            for drop in current.fit.space.effects:
                without = self._without(base, current, drop.name)
                again = weighed(without, current.joint, current.judged)
                # What would not be let in may still carry the others: only its gain counts here.
                if again.gain <= asked_gain(again, self.settings, tied=self.tied):
                    smaller.append(without)
            if not smaller:
                break
            current = min(smaller, key=lambda c: (-c.score, c.names))
        return current

    def _places(
        self, base: Hypothesis, best: Hypothesis, tried: Sequence[Hypothesis]
    ) -> tuple[Hypothesis, dict[str, Place]]:
        """For each effect of the best model, what else could stand in its place.

        A rival that scores better becomes the best, once: greedy steps may have begun wrongly.
        """
        if not best.names:
            return best, {}
        if len(best.names) == 1:
            pool = [c for c in tried if len(c.names) == 1 and c.names != best.names]
            return best, {best.names[0]: Place(base, tuple(pool[:5]))}
        for attempt in range(2):
            out = {name: self._place(base, best, name) for name in best.names}
            rivals = [c for place in out.values() for c in place.rivals]
            better = [c for c in rivals if c.score > best.score]
            if not better or attempt == 1:
                break
            winner = max(better, key=lambda c: c.score)
            best = weighed(base, winner.joint, winner.judged)
        return best, out

    def _place(self, base: Hypothesis, best: Hypothesis, name: str) -> Place:
        """The best model without one of its several effects, and with others in its place."""
        keep = tuple(e for e in best.fit.space.effects if e.name != name)
        reduced = self._without(base, best, name)
        ranked = screen(reprobe(self._probes, reduced.fit))
        ranked = [s for s in ranked if s.effect.name not in best.names][:4]
        values = reduced.fit.point.effects
        starts = [Start((*keep, s.effect), {**values, s.effect.name: s.start}) for s in ranked]
        found = self._judged(reduced, list(joint_fits(reduced.fit, starts).values()))
        return Place(reduced, tuple(found))


def weighed(before: Hypothesis, joint: JointFit, judged: Judged) -> Hypothesis:
    """A fit that was judged, with its gains over the model `before`."""
    rise = before.doubt.scores(judged) - before.doubt.scores(before.judged)
    gain, se = cluster_gain(before.fit.problem, judged.hold, rise)
    touched = touched_outputs(before.judged, judged)
    masks = before.fit.problem.dataset.regime_masks
    return Hypothesis(
        joint,
        judged,
        gain,
        se,
        touched,
        before.judged.excess(list(touched)),
        float(sum(regime_gains(before.fit, joint.fit, masks).values())),
        len(rise),
    )


def _best_first(c: Hypothesis) -> tuple[float, tuple[str, ...]]:
    return -c.gain, c.names


def short_list(
    ranked: Sequence[Screened], count: int, unscreened: Collection[str] = ()
) -> list[Screened]:
    """The best overall, the best of every sub-model that gains anything, and the `unscreened`."""
    chosen = [s for s in ranked if s.gain > 0][:count]
    for s in ranked:
        if s.gain > 2.0 and all(c.effect.sub_model != s.effect.sub_model for c in chosen):
            chosen.append(s)
    chosen += [s for s in ranked if s.effect.name in unscreened and s not in chosen]
    return chosen
