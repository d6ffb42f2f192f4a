"""The verdict of a check-up: what has changed, from now − then with the same inputs.

A rival predicts the change of a pair by a replay with it minus one without. Floor and correlation
of the residual come from the repeats of the good bench.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from smad.diagnosis.answer import Answer, answer_of
from smad.diagnosis.data.guards import FIT
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.difference import PairedRuns, pair_runs, question_of_pairs
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.paired.notes import notes_of
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.rivals.search import run_search
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CHECK_UP, PAIRED, RunRecord
from smad.progress import Say, silent


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
