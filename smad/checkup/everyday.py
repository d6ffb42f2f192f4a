"""Everyday runs that repeat known-good ones are compared with them as a check-up would."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smad.checkup.commission import commissioned, judged
from smad.checkup.errors import PairingError
from smad.checkup.files import Found, match
from smad.diagnosis.plant import PlantModel
from smad.gap.records import RepeatedRecord

_LEAST_REPEATS = 2


def repeated(
    plant: PlantModel,
    good: Sequence[Found],
    runs: Sequence[Found],
    progress: Callable[[str], None] = lambda text: None,
) -> RepeatedRecord | None:
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
        return RepeatedRecord(matched.lines, min(repeats.values()))
    progress("comparing with the runs that they repeat")
    try:
        reference = commissioned(plant, groups, progress=progress)
        verdict = judged(plant, reference, now, progress=progress).verdict
    except PairingError as error:
        return RepeatedRecord(matched.lines, _LEAST_REPEATS, headline=f"not possible: {error}")
    return RepeatedRecord(
        matched.lines,
        reference.repeats,
        verdict.outcome,
        verdict.headline,
        {" + ".join(x.names): x.probability for x in verdict.likely},
    )
