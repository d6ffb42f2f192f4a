"""A check-up: the runs of now against a baseline, or against files of a good day."""

import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from smad.checkup.baseline import FIRST, good_series, require_same
from smad.checkup.errors import BaselineError
from smad.checkup.files import (
    Matched,
    RunFile,
    match,
    read_folder,
    read_good,
    require_one_bench,
    require_other_recordings,
)
from smad.checkup.investigation import REPORT, read_report, recorded_runs
from smad.checkup.judge import Judgement, commissioned, judge_runs
from smad.checkup.programme import Programme
from smad.checkup.proposal import Proposal, propose
from smad.checkup.series import NOW, Player, folder_for, play_series, read_state
from smad.checkup.store import load
from smad.counted import counted
from smad.diagnosis.errors import PairingError
from smad.diagnosis.plant import PlantModel
from smad.progress import Say, silent
from smad.runlog.paths import passed_over

_NUMBER = re.compile(r"\d[\d.]*")


def check_baseline(
    folder: Path,
    plant: PlantModel,
    programme: Programme,
    now: Path | None,
    opened: AbstractContextManager[Player],
    *,
    out: Path | None,
    bench: str,
    say: Say,
    progress: Say,
) -> Judgement:
    """The verdict over the runs in `now` that the baseline of a folder has.

    Without `now` the runs of the programme that the baseline has are played first, by the player
    that `opened` yields, into `out` or the next of FOLDER/now-1, now-2 …. Raises BaselineError for
    a baseline of another bench or programme and where `now` has no run of the baseline,
    PairingError for runs that cannot be compared, and what the player raises.
    """
    baseline, played = load(folder, plant), now is None
    names = baseline.reference.names
    if now is None:
        with opened as player:
            play = player(NOW)
            require_same(folder, baseline, bench, programme, part=True)
            # A baseline of the quick part has nothing to compare the other runs with.
            shared = replace(programme, runs=tuple(r for r in programme.runs if r.name in names))
            now = out or folder_for(folder, "now", shared)
            play_series(now, shared, play, folder / FIRST, say)
        say(f"played into {now}; --now {now} judges these runs again")
    state = read_state(now)
    if state is not None and state.ended:
        say(f"not all of it was played: {state.ended}")
    runs = [f for f in read_folder(now) if f.name in names]
    _say_notes(runs, say)
    if not played:
        # Runs that were not recorded for it may be the good ones.
        for place in good_series(folder):
            good = [f for f in read_folder(place) if f.name in {n.name for n in runs}]
            require_one_bench([*good, *runs])
            require_other_recordings(good, runs)
    if not runs:
        raise BaselineError(
            f"{now} holds no run of the baseline {folder}",
            limit=", ".join(sorted(names)),
            action="name the files after the runs of the programme, or use --good",
        )
    return judge_runs(plant, baseline.reference, [(f.run, f.name) for f in runs], progress=progress)


def proposed(folder: Path, plant: PlantModel, progress: Say) -> tuple[Judgement, Proposal]:
    """The verdict over the newest check-up or investigation in the folder of a baseline, and what
    to play after it if each run takes as long.

    Raises BaselineError when it has none.
    """
    baseline = load(folder, plant)
    answers = (*folder.glob("now-*"), *folder.glob("investigation-*"))
    places = [place for place in answers if any(place.glob("*.mcap"))]
    if not places:
        raise BaselineError(
            f"{folder} holds no check-up yet", action="make one with smad gap checkup --baseline"
        )
    newest = max(places, key=lambda place: place.stat().st_mtime)
    names = baseline.reference.names
    if (newest / REPORT).exists():
        runs = recorded_runs(newest, read_report(newest / REPORT))
    else:
        runs = [(f.run, f.name) for f in read_folder(newest)]
    runs = [(run, name) for run, name in runs if name in names]
    judgement = judge_runs(plant, baseline.reference, runs, progress=progress)
    return judgement, propose(judgement, dict.fromkeys(names, 1.0), left_s=1.0)


def check_files(plant: PlantModel, good: Path, now: Path, *, say: Say, progress: Say) -> Judgement:
    """The verdict over the files of a good day and of now in two folders.

    `say` notes which files are left out, and which runs were paired.
    """
    progress("reading")
    then, runs = read_good(good, say), read_folder(now)
    for folder, read in ((good, then), (now, runs)):
        files = sorted(p for p in folder.rglob("*") if p.is_file())
        if text := passed_over(folder, files, [run.path for run in read]):
            say(text)
    _say_notes([*then, *runs], say)
    judgement, matched = checked_files(plant, then, runs, progress)
    for text in matched.lines:
        say(text)
    return judgement


def checked_files(
    plant: PlantModel, good: Sequence[RunFile], now: Sequence[RunFile], progress: Say = silent
) -> tuple[Judgement, Matched]:
    """The verdict over files of a good day and of now, and which runs were paired.

    Raises PairingError when nothing is paired, when a run of now is one of the good ones, when a
    good one is given twice, and when runs of two benches are mixed.
    """
    require_one_bench([*good, *now])
    require_other_recordings(good, now)
    matched = match(plant, good, now)
    if not matched.now:
        raise PairingError(
            "no new run has the inputs of a good run",
            value=f"{len(good)} good, {len(now)} now",
            action="play the same programme on both days; smad docs guide/check-up says how",
        )
    reference = commissioned(plant, matched.groups, progress=progress)
    return judge_runs(plant, reference, matched.now, progress=progress), matched


def _say_notes(runs: Sequence[RunFile], say: Say) -> None:
    """Say the notes of runs; of notes that differ only in numbers the first."""
    alike: dict[str, list[str]] = {}
    for run in runs:
        for note in run.run.notes:
            alike.setdefault(_NUMBER.sub("", note), []).append(f"{run.path}: {note}")
    for first, *others in alike.values():
        say(f"{first}; likewise in {counted(len(others), 'more run')}" if others else first)
