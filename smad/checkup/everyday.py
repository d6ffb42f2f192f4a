"""Everyday runs that repeat known-good ones are compared with them as a check-up would."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from smad.checkup.commission import commissioned
from smad.checkup.files import Found, match
from smad.checkup.judge import judged
from smad.diagnosis.errors import PairingError
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.verdict import Repeated

_LEAST_REPEATS = 2


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
