"""What a verdict leaves confused, and the experiment that would best tell it apart.

Each hypothesis is a fitted model. For an experiment of the catalogue, both predict what would be
measured; the second may still adapt its parameters, as far as the data so far allow. What is left
between them, in floors, is the separation d², in standard errors squared. How much of it can be
counted on is another question, which runs not fitted to answer (`assess.counted_share`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from smad.gap.compare.assess import counted_share
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track
from smad.gap.data.replay import Dataset, Detail
from smad.gap.fit.hypothesis import Hypothesis
from smad.gap.fit.joint import JointFit, independent_share
from smad.gap.fit.lsq import FitResult
from smad.gap.fit.stages import Prepared
from smad.gap.model.whiten import OutputNoise, Whitening
from smad.gap.plant import Array, Experiment, catalogue_of, performed
from smad.gap.records import NAMED, ExperimentRecord, Outcome

_STEP = 0.2
_MOST_RIVALS = 3


def enough(counted: Sequence[float], wanted: float) -> int | None:
    """How many of these, from the first on, add up to a separation; None if all do not.

    Of different experiments: a second run of one has the same discrepancy in it again.
    """
    total = 0.0
    for n, own in enumerate(counted, start=1):
        total += own
        if total >= wanted:
            return n
    return None


class Trial:
    """One experiment, predicted by each of several fitted models.

    The separation is Σ w_i w_j d²_ij over the pairs of models, normalised by Σ w_i w_j, with
    d²_ij = min_Δ ‖y_i − y_j − J_j Δ‖²_Σ⁻¹ + Δᵀ H_j Δ, and H_j what the data so far say of the
    parameters of j. `bound` is the same with Δ = 0, which no separation exceeds and needs no J.
    """

    def __init__(
        self,
        fits: Sequence[FitResult],
        weights: Sequence[float],
        experiment: Experiment,
        noise: Mapping[str, OutputNoise],
    ) -> None:
        self.fits, self.weights, self.experiment = fits, weights, experiment
        first = fits[0].problem.dataset
        run = performed(first.plant, experiment.name, fits[0].point, first.settings.seed)
        self._ev = Dataset(
            first.plant,
            [run],
            first.views,
            first.settings,
            first.executor,
            fast=first.detail is not Detail.FINE,
        )
        self._whitening = Whitening(self._ev, noise)
        self._share = independent_share(fits[0])
        self._y = self._ev.predict([fit.point for fit in fits])
        pairs = permutations(range(len(fits)), 2)
        self._apart = {(i, j): self._whitening.white(self._y[i] - self._y[j]) for i, j in pairs}
        self.bound = self._mean(lambda s, j: float(s @ s))

    def separation(self) -> float:
        """The separation, every model adapting its parameters."""
        known = [(self._slopes(j), _information(fit)) for j, fit in enumerate(self.fits)]

        def adapted(s: Array, j: int) -> float:
            J, H = known[j]
            step = np.linalg.solve(J.T @ J + H, J.T @ s)
            left = s - J @ step
            return float(left @ left + step @ H @ step)

        return self._mean(adapted)

    def _mean(self, d2: Callable[[Array, int], float]) -> float:
        total = weight = 0.0
        for (i, j), s in self._apart.items():
            w = self.weights[i] * self.weights[j]
            total += w * self._share * d2(s, j)
            weight += w
        return total / weight if weight > 0 else 0.0

    def _slopes(self, j: int) -> Array:
        """White slopes of model j; shape (rows, coordinates)."""
        fit = self.fits[j]
        moved = _moved(fit)
        signed = np.array([q[i] - fit.p[i] for i, q in enumerate(moved)])
        change = self._ev.predict([fit.space.point(q) for q in moved]) - self._y[j]
        return self._whitening.white(np.ascontiguousarray((change / signed[:, None]).T))


def _moved(fit: FitResult) -> list[Array]:
    lo, hi = fit.space.bounds()
    out = []
    for i in range(fit.space.size):
        q = fit.p.copy()
        q[i] += _STEP if q[i] + _STEP <= hi[i] else -min(_STEP, q[i] - lo[i])
        out.append(q)
    return out


def _information(fit: FitResult) -> Array:
    H, _ = fit.normal_equations()
    _, precision = fit.space.prior()
    return np.asarray(independent_share(fit) * H.sum(axis=0) + precision)


def propose(
    fits: Sequence[FitResult],
    weights: Sequence[float],
    noise: Mapping[str, OutputNoise],
    catalogue: Sequence[Experiment],
    most: int = 4,
    *,
    share: float = 1.0,
) -> list[ExperimentRecord]:
    """The `most` best experiments of the catalogue, best first, for models of these `weights`.

    `share` of what the models predict is counted (`assess.counted_share`).

    The slopes are what takes time: an experiment that cannot come among them is not asked for its.
    """
    trials = [Trial(fits, weights, e, noise) for e in catalogue]
    found: list[tuple[float, Experiment]] = []
    for trial in sorted(trials, key=lambda t: (-t.bound, t.experiment.name)):
        if len(found) == most and trial.bound < found[-1][0]:
            break
        found.append((trial.separation(), trial.experiment))
        found = sorted(found, key=lambda q: (-q[0], q[1].name))[:most]
    together = np.cumsum([share * d2 for d2, _ in found]).tolist()
    return [
        ExperimentRecord(e.name, e.title, e.duration_s, d2, e.command, share * d2, so_far)
        for (d2, e), so_far in zip(found, together, strict=True)
    ]


@dataclass(frozen=True)
class Confused:
    """Models that the runs do not tell apart, the favoured one first, and their probabilities."""

    models: tuple[Hypothesis, ...]
    weights: tuple[float, ...]


def confused(
    prepared: Prepared, track: Track, outcome: Outcome, groups: Mapping[str, Sequence[str]]
) -> Confused | None:
    """The causes of a group, or a cause and the other values of the parameters that stand for it.

    None where a verdict leaves nothing confused, or nothing that has a model.
    """
    if outcome is Outcome.AMBIGUOUS:
        return _group(track.selection, groups)
    if track.displaced or (track.imitated and outcome in NAMED):
        free = Hypothesis(JointFit(prepared.fit, ()), prepared.free)
        return Confused((track.asked.best, free), (0.5, 0.5))
    return None


def _group(s: Selection, groups: Mapping[str, Sequence[str]]) -> Confused:
    name = next(n for n in s.best.names if groups.get(n))
    near = [r for r in s.rivals[name] if any(n in groups[name] for n in r.names)]
    near = near[:_MOST_RIVALS]
    table = s.probability[name]
    weights = [table.get(name, 1.0)]
    weights += [max(table.get(n, 0.0) for n in r.names if n not in s.best.names) for r in near]
    return Confused((s.best, *near), tuple(weights))


def parting_experiments(prepared: Prepared, question: Confused) -> list[ExperimentRecord]:
    """The best experiments of the plant's catalogue for a question, best first."""
    favoured, other, *_ = question.models
    return propose(
        [m.fit for m in question.models],
        question.weights,
        prepared.noise,
        catalogue_of(prepared.plant),
        share=counted_share(favoured, other),
    )
