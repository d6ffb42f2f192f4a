"""A baseline from the runs of good days, and a check-up from files of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from smad.checkup.files import (
    Found,
    Matched,
    match,
    require_one_bench,
    require_other_recordings,
)
from smad.checkup.judge import Judged, judged
from smad.checkup.paired.reference import Reference, reference_from
from smad.diagnosis.errors import PairingError
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun


def _silent(text: str) -> None:
    pass


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    start: ModelPoint | None = None,
    progress: Callable[[str], None] = _silent,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group."""
    placed = with_places(plant)
    reference = reference_from(placed, groups, start, progress)
    played = [r.played for r in reference.runs]
    found = responses(placed, reference.point, played, progress=progress)
    return replace(reference, responses=found.runs)


def checked_files(
    plant: PlantModel,
    good: Sequence[Found],
    now: Sequence[Found],
    progress: Callable[[str], None] = _silent,
) -> tuple[Judged, Matched]:
    """The verdict over files of a good day and of now, and what was paired with what.

    Raises PairingError when nothing is paired, when a run of now is one of the good ones, when a
    good one is given twice, and when runs of two benches are mixed.
    """
    require_one_bench([*good, *now])
    require_other_recordings(good, now)
    matched = match(plant, good, now)
    if not matched.now:
        raise PairingError(
            "no run of now has the inputs of a good one",
            value=f"{len(good)} good, {len(now)} now",
            action="play the same programme on both days; smad docs guide/check-up says how",
        )
    reference = commissioned(plant, matched.groups, progress=progress)
    return judged(plant, reference, matched.now, progress=progress), matched
