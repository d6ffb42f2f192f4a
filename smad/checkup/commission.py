"""What a check-up knows of a good bench, from the runs of good days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.good import GoodRuns, good_runs
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.rivals.changes import changes_at
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent


@repeatable
def commissioned(
    plant: PlantModel, groups: Sequence[Sequence[GapRun]], progress: Say = silent
) -> GoodRuns:
    """The good runs, the repeats of each run of a programme in a group, with what laws and effects
    change of them.

    Raises PairingError when the runs of a group do not have the same inputs.
    """
    placed = with_places(plant)
    progress("reference model")
    good = good_runs(placed, groups)
    played = [run.played for run in good.runs]
    of_laws = responses(placed, good.point, played, progress=progress)
    progress("what each effect changes")
    changes = changes_at(placed, good.point, played, placed.effects)
    return replace(good, responses=of_laws, changes=changes)
