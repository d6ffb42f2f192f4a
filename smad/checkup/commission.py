"""The reference of a good bench, from the runs of good days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.good import GoodRuns, good_runs
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import Responses, responses
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.rivals.changes import Changes, changes_at
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent


@dataclass(frozen=True, kw_only=True)
class Reference(GoodRuns):
    """Everything that a check-up needs of the good bench.

    `responses` are those of the plant's places, `changes` those of its effects, of each run.
    """

    responses: Responses
    changes: Changes


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    progress: Say = silent,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group.

    Raises PairingError when the runs of a group do not have the same inputs.
    """
    placed = with_places(plant)
    progress("reference model")
    good = good_runs(placed, groups)
    played = [run.played for run in good.runs]
    known = responses(placed, good.point, played, progress=progress)
    progress("what each effect changes")
    return Reference(
        runs=good.runs,
        point=good.point,
        floor=good.floor,
        repeats=good.repeats,
        responses=known,
        changes=changes_at(placed, good.point, played, placed.effects),
    )
