"""Forward and backward selection of effects, judged on runs and regimes left out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.gap.fit import JointFit, Start, joint_fits
from smad.gap.judge import Judged, judge, regime_gains, shrink
from smad.gap.lsq import Fitted, Problem
from smad.gap.plant import Array, Effect
from smad.gap.replay import Index
from smad.gap.screen import Probes, Screened, probe, reprobe, screen
from smad.gap.settings import Settings
from smad.gap.significance import block_of, resample_weights, tail_p

_TOUCHED = 0.1


@dataclass(frozen=True)
class Candidate:
    """A model of the selection: a set of effects, fitted and judged.

    `gain` is the rise of the held-out log-likelihood over the model it was added to, `gain_se` its
    standard error over runs and blocks, `p_value` that of the whole selection's null, `touched` the
    outputs that carry the effect's signature, `shrink_gain` the rise of S over them (or over all
    outputs, if larger), `excess_before` the gap over them without it, `regime_gain` the sum of
    gains on regimes left out, `cells` the number of cells that were judged.
    """

    joint: JointFit
    judged: Judged
    gain: float = 0.0
    gain_se: float = 0.0
    p_value: float = 1.0
    touched: tuple[str, ...] = ()
    shrink_gain: float = 0.0
    excess_before: float = 0.0
    regime_gain: float = 0.0
    cells: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        return self.joint.names

    @property
    def fit(self) -> Fitted:
        return self.joint.fit


@dataclass(frozen=True)
class Selection:
    """The outcome: `base` (refit only), `best`, and what stood beside it.

    `steps` are the accepted models in order. `rivals` are, for each effect of `best`, the models
    with that effect replaced by another. `probability` is, for each effect of `best`, that of every
    effect in its place, "" being none. `screened` is the first screening.
    """

    base: Candidate
    best: Candidate
    steps: tuple[Candidate, ...]
    rivals: dict[str, tuple[Candidate, ...]]
    probability: dict[str, dict[str, float]]
    screened: tuple[Screened, ...]
    tried: tuple[Candidate, ...]

    @classmethod
    def without_effects(cls, refit: Candidate, asked: Selection) -> Selection:
        """Another refit, with nothing in it, as the answer to what `asked` has screened."""
        return cls(refit, refit, (), {}, {}, asked.screened, ())


def cluster_gain(problem: Problem, hold: Problem | None, gain: Array) -> tuple[float, float]:
    """Sum of a cell-wise gain and its standard error over blocks of time."""
    sums = block_sums(problem, hold, gain)
    total = float(sums.sum())
    return total, float(np.std(sums) * np.sqrt(len(sums)))


def block_sums(problem: Problem, hold: Problem | None, values: Array) -> Array:
    """Sums of what `Judged.scores` would list, over the cells of each block of time of each run."""
    block = block_of(*held_cells(problem, hold))
    return np.asarray(np.bincount(block, weights=values), dtype=np.float64)


def held_cells(problem: Problem, hold: Problem | None) -> tuple[Index, Index]:
    """Run and block of every cell that `Judged.scores` lists."""
    a = problem.evidence
    if hold is None:
        return a.cell_run, a.cell_block
    b = hold.evidence
    return np.r_[a.cell_run, b.cell_run + len(a.runs)], np.r_[a.cell_block, b.cell_block]


def touched_outputs(before: Judged, after: Judged) -> tuple[str, ...]:
    """Outputs that carry at least a tenth of what an effect changes, in floors."""
    ev = after.bench.evidence
    change = np.square(after.bench.whitening.scale(after.predicted - before.predicted))
    power = {k: float(sum(change[s.rows].sum() for s in ev.rows_of(k))) for k in ev.keys}
    total = sum(power.values())
    return tuple(k for k, v in power.items() if total > 0 and v >= _TOUCHED * total)


def _clear(c: Candidate, s: Settings) -> bool:
    """Whether an effect takes most of a gap that none could overlook, if only in a few cells."""
    return c.shrink_gain >= s.clear_shrink and c.excess_before >= s.clear_excess


def asked_gain(c: Candidate, s: Settings, *, tied: bool) -> float:
    """What the held-out gain of a candidate must exceed, nats.

    Beside tied parameters every effect gains something where the bench's laws have another form
    than the model's, in proportion to the cells judged.
    """
    if not tied:
        return max(2.0, s.gain_standard_errors * c.gain_se)
    if _clear(c, s):
        return s.clear_standard_errors * c.gain_se
    if len(c.names) > 1:
        return max(s.further_gain * c.cells, s.further_standard_errors * c.gain_se)
    return max(s.since_gain * c.cells, s.since_standard_errors * c.gain_se)


def acceptable(c: Candidate, s: Settings, *, tied: bool) -> bool:
    """Whether the last effect of a candidate may enter, beside tied parameters or free ones."""
    stands = c.gain > asked_gain(c, s, tied=tied) and c.p_value <= s.significance
    if tied:
        # Beside tied parameters an effect stands out by its score although the background is
        # larger; but what the form of a law leaves in one regime is no help in another. So large
        # as a cause may be that acts in one regime only, it is not.
        share = 0.0 if c.gain > s.regime_sure * c.cells else s.regime_share
        return stands and c.regime_gain > share * c.gain
    takes = c.shrink_gain >= s.min_shrink_gain and c.excess_before >= s.min_excess
    return stands and takes and c.gain + c.regime_gain > 0.0


class Selector:
    """Forward steps, swaps and backward steps over the effects of a library.

    `unscreened` effects are fitted and judged even where screening gains nothing by them.
    """

    def __init__(
        self,
        refit: Fitted,
        hold: Problem | None,
        effects: Sequence[Effect],
        null: Callable[[Probes], Array],
        progress: Callable[[str], None] = lambda text: None,
        *,
        is_new: Callable[[Candidate], bool] = lambda candidate: True,
        unscreened: Collection[str] = (),
    ) -> None:
        self.refit, self.hold, self.is_new = refit, hold, is_new
        self.unscreened = unscreened
        self.tied = refit.space.tie is not None
        # The order in which a library lists its effects must not matter.
        self.effects = tuple(sorted(effects, key=lambda e: e.name))
        self.settings: Settings = refit.problem.evidence.settings
        self._null_of, self._null = null, np.zeros(0)
        self.progress = progress
        self.masks = refit.problem.evidence.regime_masks()
        # What is asked twice of the same fit, with the fit, so that its identity stays its own.
        self._refits: dict[tuple[int, tuple[str, ...]], tuple[Fitted, JointFit]] = {}
        self._less: dict[tuple[int, str], tuple[Fitted, Candidate]] = {}
        self._news: dict[int, tuple[Fitted, bool]] = {}

    def run(self) -> Selection:
        """The whole selection."""
        base = Candidate(JointFit(self.refit, ()), judge([self.refit], self.hold)[0])
        current = base
        steps: list[Candidate] = []
        tried: list[Candidate] = []
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
        best, rivals = self._rivals(base, best, tried)
        probability = {
            name: self._probability(name, base, best, others) for name, others in rivals.items()
        }
        if not rivals and tried:
            probability[""] = self._probability("", base, base, tuple(tried[:4]))
        return Selection(base, best, tuple(steps), rivals, probability, tuple(first), tuple(tried))

    def _level(
        self, current: Candidate, *, first_level: bool
    ) -> tuple[list[Screened], list[Candidate]]:
        if first_level:
            self._probes = probe(current.fit, self.effects)
            self._null = self._null_of(self._probes)
        ranked = screen(reprobe(self._probes, current.fit)) if self.effects else []
        count = self.settings.survivors if first_level else max(3, self.settings.survivors - 3)
        survivors = _short_list(ranked, count, self.unscreened)
        self.progress(f"fitting {len(survivors)} candidates")
        starts = []
        for s in survivors:
            sets = (*current.fit.space.effects, s.effect)
            before = dict(current.fit.point.effects)
            starts += [
                Start(sets, {**before, s.effect.name: values})
                for values in (s.start, s.second)[: self.settings.starts]
                if values is not None
            ]
            if first_level and not self.tied:
                starts.append(Start(sets, {s.effect.name: s.start}, from_centre=True))
        joints = joint_fits(current.fit, starts)
        return ranked, self._judged(current, list(joints.values()))

    def _judged(self, before: Candidate, joints: Sequence[JointFit]) -> list[Candidate]:
        """Candidates with their gains over `before`, best first."""
        judged = judge([j.fit for j in joints], self.hold)
        out = [self._candidate(before, j, v) for j, v in zip(joints, judged, strict=True)]
        return sorted(out, key=_best_first)

    def _candidate(self, before: Candidate, joint: JointFit, judged: Judged) -> Candidate:
        scores = judged.scores()
        gain, se = cluster_gain(before.fit.problem, self.hold, scores - before.judged.scores())
        touched = touched_outputs(before.judged, judged)
        rises = [
            shrink(judged.excess(keys), before.judged.excess(keys))
            for keys in (None, list(touched))
        ]
        likelihood_gain = before.fit.objective - joint.fit.objective
        return Candidate(
            joint,
            judged,
            gain,
            se,
            tail_p(likelihood_gain, self._null),
            touched,
            max(rises),
            before.judged.excess(list(touched)),
            float(sum(regime_gains(before.fit, joint.fit, self.masks).values())),
            len(scores),
        )

    def _first(self, candidates: Sequence[Candidate]) -> Candidate | None:
        return next((c for c in candidates if self._enters(c)), None)

    def _on_equal_terms(
        self, before: Candidate, chosen: Candidate, candidates: list[Candidate]
    ) -> tuple[Candidate, list[Candidate]]:
        """The model before, refitted from where a candidate has taken its parameters.

        A candidate's fit goes on where the other had ended. What it gains because the parameters
        have come to a better place is not its effect's: if the model before does better from there,
        too, that is what all candidates are compared with.
        """
        joint = self._refitted(chosen, before.fit.space.effects)
        if joint.fit.objective >= before.fit.objective:
            return before, candidates
        fairer = replace(before, joint=joint, judged=judge([joint.fit], self.hold)[0])
        again = [self._candidate(fairer, c.joint, c.judged) for c in candidates]
        return fairer, sorted(again, key=_best_first)

    def _enters(self, c: Candidate) -> bool:
        if not acceptable(c, self.settings, tied=self.tied):
            return False
        # However its gain is reckoned, its fit is judged as it was.
        known = self._news.get(id(c.fit))
        if known is None:
            known = self._news[id(c.fit)] = (c.fit, self.is_new(c))
        return known[1]

    def _refitted(self, current: Candidate, effects: tuple[Effect, ...]) -> JointFit:
        names = tuple(e.name for e in effects)
        known = self._refits.get((id(current.fit), names))
        if known is None:
            values = current.fit.point.effects
            start = Start(effects, {name: values[name] for name in names})
            joint = next(iter(joint_fits(current.fit, [start], finish=1).values()))
            known = self._refits[id(current.fit), names] = (current.fit, joint)
        return known[1]

    def _without(self, base: Candidate, current: Candidate, name: str) -> Candidate:
        """The model refitted without one of its effects; the same for whoever asks first."""
        known = self._less.get((id(current.fit), name))
        if known is None:
            keep = tuple(e for e in current.fit.space.effects if e.name != name)
            joint = self._refitted(current, keep)
            without = self._candidate(base, joint, judge([joint.fit], self.hold)[0])
            known = self._less[id(current.fit), name] = (current.fit, without)
        return known[1]

    def _backward(self, base: Candidate, current: Candidate) -> Candidate:
        """Drops effects that the others have made superfluous."""
        while len(current.names) > 1:
            smaller = []
            for drop in current.fit.space.effects:
                without = self._without(base, current, drop.name)
                again = self._candidate(without, current.joint, current.judged)
                # What would not be let in may still carry the others: only its gain counts here.
                if again.gain <= asked_gain(again, self.settings, tied=self.tied):
                    smaller.append((again.gain, without))
            if not smaller:
                break
            current = min(smaller, key=lambda pair: (pair[0], pair[1].names))[1]
        return current

    def _rivals(
        self, base: Candidate, best: Candidate, tried: Sequence[Candidate]
    ) -> tuple[Candidate, dict[str, tuple[Candidate, ...]]]:
        """For each effect of the best model, the best models with another in its place.

        A rival that scores better becomes the best, once: greedy steps may have begun wrongly.
        """
        if not best.names:
            return best, {}
        if len(best.names) == 1:
            pool = [c for c in tried if len(c.names) == 1 and c.names != best.names]
            return best, {best.names[0]: tuple(pool[:5])}
        for attempt in range(2):
            out: dict[str, tuple[Candidate, ...]] = {}
            for name in best.names:
                keep = tuple(e for e in best.fit.space.effects if e.name != name)
                reduced = self._without(base, best, name)
                ranked = screen(reprobe(self._probes, reduced.fit))
                ranked = [s for s in ranked if s.effect.name not in best.names][:4]
                values = reduced.fit.point.effects
                starts = [
                    Start((*keep, s.effect), {**values, s.effect.name: s.start}) for s in ranked
                ]
                found = self._judged(reduced, list(joint_fits(reduced.fit, starts).values()))
                out[name] = tuple(found)
            total = best.judged.scores().sum()
            better = [c for found in out.values() for c in found if c.judged.scores().sum() > total]
            if not better or attempt == 1:
                break
            winner = max(better, key=lambda c: float(c.judged.scores().sum()))
            best = self._candidate(base, winner.joint, winner.judged)
        return best, out

    def _probability(
        self, place: str, base: Candidate, best: Candidate, others: Sequence[Candidate]
    ) -> dict[str, float]:
        """Posterior of the effect in one place, by a Bayesian bootstrap over runs and blocks.

        `place` is the effect of `best` that `others` replace, "" where `best` has none.
        """
        models = {"": base, **{differing(best, c): c for c in others}, place: best}
        names = sorted(models)
        scores = np.array([models[n].judged.scores() for n in names])
        runs, blocks = held_cells(best.fit.problem, self.hold)
        rng = np.random.default_rng(self.settings.seed + 17)
        weight = resample_weights(runs, blocks, self.settings.bootstrap, rng)
        total = weight @ scores.T
        total -= total.max(axis=1, keepdims=True)
        posterior = np.exp(total)
        posterior /= posterior.sum(axis=1, keepdims=True)
        return dict(zip(names, posterior.mean(axis=0).tolist(), strict=True))


def _best_first(c: Candidate) -> tuple[float, tuple[str, ...]]:
    return -c.gain, c.names


def differing(model: Candidate, other: Candidate) -> str:
    """The effect of `other` that `model` lacks."""
    extra = [n for n in other.names if n not in model.names]
    return extra[0] if extra else ""


def _short_list(
    ranked: Sequence[Screened], count: int, unscreened: Collection[str] = ()
) -> list[Screened]:
    """The best overall, the best of every sub-model that gains anything, and the `unscreened`."""
    chosen = [s for s in ranked if s.gain > 0][:count]
    for s in ranked:
        if s.gain > 2.0 and all(c.effect.sub_model != s.effect.sub_model for c in chosen):
            chosen.append(s)
    chosen += [s for s in ranked if s.effect.name in unscreened and s not in chosen]
    return chosen
