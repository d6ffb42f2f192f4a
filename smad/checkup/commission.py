"""The reference of a good bench, from the runs of good days."""

from __future__ import annotations

from collections.abc import Sequence

from smad.checkup.paired.reference import Reference, reference_from
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    progress: Say = silent,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group."""
    return reference_from(with_places(plant), groups, progress)
