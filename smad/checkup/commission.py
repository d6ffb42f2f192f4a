"""A baseline from the runs of good days, and a check-up from files of both.

Everyday runs that repeat known-good ones are compared with them as a check-up would.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smad.checkup.files import Found, Matched, match, require_one_bench, require_other_recordings
from smad.checkup.judge import Judged, judged
from smad.checkup.paired.reference import Reference, reference_from
from smad.diagnosis.errors import PairingError
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import Repeated

_LEAST_REPEATS = 2


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    progress: Callable[[str], None] = lambda text: None,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group."""
    return reference_from(with_places(plant), groups, progress)


def checked_files(
    plant: PlantModel,
    good: Sequence[Found],
    now: Sequence[Found],
    progress: Callable[[str], None] = lambda text: None,
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


def repeated(
    plant: PlantModel,
    good: Sequence[Found],
    runs: Sequence[Found],
    progress: Callable[[str], None] = lambda text: None,
) -> Repeated | None:
    """What the runs say that repeat the inputs of known-good ones; None where none does.

    Without two good recordings of the same inputs there is no repeat floor, and nothing is said
    but which runs repeat which.
    """
    known = {f.run.digest for f in good}
    matched = match(plant, good, [f for f in runs if f.run.digest not in known])
    if not matched.now:
        return None
    repeats = {g[0].name: len(g) for g in matched.groups}
    groups = [g for g in matched.groups if len(g) >= _LEAST_REPEATS]
    now = [(run, name) for run, name in matched.now if repeats[name] >= _LEAST_REPEATS]
    if not now:
        return Repeated(lines=matched.lines, repeats=min(repeats.values()))
    progress("comparing with the runs that they repeat")
    try:
        reference = commissioned(plant, groups, progress=progress)
        verdict = judged(plant, reference, now, progress=progress).verdict
    except PairingError as error:
        return Repeated(
            lines=matched.lines, repeats=_LEAST_REPEATS, headline=f"not possible: {error}"
        )
    return Repeated(
        lines=matched.lines, repeats=reference.repeats, outcome=verdict.outcome,
        headline=verdict.headline,
    )  # fmt: skip
