"""The diagnosis of everyday runs; those that repeat known-good ones are checked up as well."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from smad.checkup.commission import commissioned
from smad.checkup.files import RunFile, match
from smad.checkup.judge import judged
from smad.diagnosis import diagnose
from smad.diagnosis.answer import Answer
from smad.diagnosis.errors import PairingError
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import read_gap_runs, usable
from smad.diagnosis.verdict import Repeated
from smad.progress import Say, silent
from smad.records.channels import MappingFile

_LEAST_REPEATS = 2


def diagnose_files(
    plant: PlantModel,
    runs: Sequence[Path],
    good: Sequence[Path],
    hold_out: Sequence[Path],
    trusted: Sequence[str] = (),
    *,
    mapping: MappingFile | None = None,
    progress: Say,
) -> Answer:
    """Where the plant and the runs of files disagree; see `smad.diagnosis.diagnose`.

    `trusted` are names or paths of runs that the nominal model's opinion does not refuse;
    `mapping` says how tables are written.
    """
    progress("reading")
    every = (*runs, *good, *hold_out)
    fitted, known, judged_on = (
        read_gap_runs(paths, every, trusted, mapping) for paths in (runs, good, hold_out)
    )
    answer = diagnose(fitted, plant=plant, good=known, hold_out=judged_on, progress=progress)
    now = _usable((*runs, *hold_out), [*fitted, *judged_on])
    comparison = repeated(plant, _usable(good, known), now, progress)
    return answer.with_verdict(repeated=comparison)


def _usable(paths: Sequence[Path], runs: Sequence[GapRun]) -> list[RunFile]:
    read = zip(paths, map(usable, runs), strict=True)
    return [RunFile.of(path, run) for path, run in read if run is not None]


def repeated(
    plant: PlantModel,
    good: Sequence[RunFile],
    runs: Sequence[RunFile],
    progress: Say = silent,
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
        lines=matched.lines,
        repeats=reference.repeats,
        outcome=verdict.outcome,
        headline=verdict.headline,
    )
