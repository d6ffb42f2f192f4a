"""What a verdict leaves confused, and the experiments that would best tell it apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from smad.gap.compare.assess import counted_share
from smad.gap.compare.nextexp import propose
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track
from smad.gap.fit.candidate import Candidate
from smad.gap.fit.joint import JointFit
from smad.gap.fit.stages import Prepared
from smad.gap.plant import catalogue_of
from smad.gap.records import NAMED, ExperimentRecord, Outcome

_MOST_RIVALS = 3


@dataclass(frozen=True)
class Confused:
    """Models that the runs do not tell apart, the favoured one first, and their probabilities."""

    models: tuple[Candidate, ...]
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
        free = Candidate(JointFit(prepared.fit, ()), prepared.free)
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
