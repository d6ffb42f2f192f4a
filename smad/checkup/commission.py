"""The good bench of a check-up, computed from the runs of good days."""

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
