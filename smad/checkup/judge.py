"""What is new with the same inputs: now − then, asked by the rule of every other question.

A rival predicts the change of a pair by a replay with it minus a replay without; the floor and the
correlation of what is left come from the repeats of the good bench.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from smad.diagnosis.answer import Answer, answer_of
from smad.diagnosis.data.guards import FIT
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.difference import Paired, paired, question_of_pairs
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.paired.notes import notes_of
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import PlantModel, SavesModel
from smad.diagnosis.rivals.search import searched
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CHECK_UP, PAIRED, QUIET, RunRecord, Verdict
from smad.progress import Say, silent
from smad.version import VERSION


@dataclass(frozen=True, kw_only=True)
class Judged:
    """An answer with the pairs that it is of."""

    pairs: Paired
    answer: Answer

    @property
    def verdict(self) -> Verdict:
        """What is told."""
        return self.answer.verdict

    @property
    def has_model(self) -> bool:
        """Whether anything was found that a model can carry."""
        return self.verdict.outcome != QUIET

    @property
    def variance(self) -> float:
        """Mean square of a row beside what is told; 1 at least."""
        search = self.answer.search
        return 1.0 if search is None else max(search.question.gap(search.final) ** 2, 1.0)


class SavablePlant(PlantModel, SavesModel, Protocol):
    """A plant that can write a model file."""


def save_model_of(plant: SavesModel, judgement: Judged, path: Path) -> None:
    """Writes the model of the good bench with what was found, and its covariance."""
    answer = judgement.answer
    model = answer.model or judgement.pairs.good.point
    plant.save_model(model, path, answer.verdict.headline, answer.uncertainty)


@repeatable
def judged(
    plant: PlantModel,
    reference: GoodRuns,
    runs: Sequence[tuple[GapRun, str]],
    *,
    exclude: Sequence[str] = (),
    progress: Say = silent,
) -> Judged:
    """The verdict over runs of now, each with the name of the good run that it repeats.

    Effects of `exclude` are not asked. Raises PairingError for inputs that differ too much, and
    GapError where the model cannot replay the runs.
    """
    began = time.perf_counter()
    placed = with_places(plant)
    pairs = paired(placed, reference, runs)
    effects = [e for e in plant.effects if e.name not in exclude]
    search = searched(question_of_pairs(pairs, effects, progress))
    answer = answer_of(search, question=CHECK_UP, gaps_of=PAIRED)
    answer = answer.with_verdict(
        notes=notes_of(pairs),
        runs=[RunRecord.of(run, FIT, name) for run, name in runs],
        plant=plant.name,
        plant_version=plant.version,
        smad_version=VERSION,
        seconds=round(time.perf_counter() - began, 2),
    )
    return Judged(pairs=pairs, answer=answer)
