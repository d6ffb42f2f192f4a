"""A check-up: the good bench from runs of good days, and what has changed, from now − then.

A rival predicts the change of a pair by a replay with it minus one without. Floor and correlation
of the residual come from the repeats of the good bench.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from smad.diagnosis.answer import Answer, answer_of
from smad.diagnosis.data.guards import FIT
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.difference import (
    PairedRuns,
    notes_of,
    pair_runs,
    question_of_pairs,
)
from smad.diagnosis.paired.good import GoodRuns, good_runs
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.rivals.changes import changes_at
from smad.diagnosis.rivals.search import run_search
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CHECK_UP, PAIRED, RunRecord
from smad.progress import Say, silent


@repeatable
def commissioned(
    plant: PlantModel, groups: Sequence[Sequence[GapRun]], progress: Say = silent
) -> GoodRuns:
    """Good runs from `groups` of repeats, with responses to laws and changes by effects.

    Raises PairingError when the runs of a group do not have the same inputs.
    """
    placed = with_places(plant)
    progress("reference model")
    good = good_runs(placed, groups, placed.effects, say=progress)
    played = [run.as_measured(placed) for run in good.runs]
    of_laws = responses(placed, good.point, played, progress=progress)
    progress("what each effect changes")
    changes = changes_at(placed, good.point, played, placed.effects)
    return replace(good, responses=of_laws, changes=changes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement(Answer):
    """An answer with the pairs that it is of."""

    pairs: PairedRuns


@repeatable
def judge_runs(
    plant: PlantModel,
    reference: GoodRuns,
    runs: Sequence[tuple[GapRun, str]],
    progress: Say = silent,
) -> Judgement:
    """The verdict over runs of now, each with the name of the good run that it repeats.

    Raises PairingError for inputs that differ too much, and GapError where the model cannot replay
    the runs.
    """
    began = time.perf_counter()
    placed = with_places(plant)
    pairs = pair_runs(placed, reference, runs)
    search = run_search(question_of_pairs(pairs, plant.effects, progress))
    answer = answer_of(search, question=CHECK_UP, gaps_of=PAIRED)
    records = [RunRecord.of(run, FIT, name) for run, name in runs]
    seconds = time.perf_counter() - began
    notes = [*answer.verdict.notes, *notes_of(pairs)]
    answer = answer.stamped(plant, seconds, notes=notes, runs=records)
    return Judgement(pairs=pairs, **vars(answer))
