"""The folder of a baseline: the good runs in it, what it belongs to, and how it is commissioned.

FOLDER/good-1, good-2 … hold the repeats, each a series; `baseline.json` and its arrays (`store`)
are computed from them.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from smad.checkup.errors import BaselineError
from smad.checkup.files import read_folder, require_one_bench
from smad.checkup.judge import commissioned
from smad.checkup.programme import Programme, shipped
from smad.checkup.series import Player, finished, folder_for, play_series, read_state
from smad.checkup.store import Baseline, load, save
from smad.counted import counted
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun
from smad.progress import Say

FIRST = "good-1"
"""The series that all others repeat."""


def commission(
    folder: Path,
    plant: PlantModel,
    programme: Programme,
    opened: AbstractContextManager[Player],
    *,
    bench: str,
    repeats: int,
    again: bool,
    say: Say,
    progress: Say,
) -> GoodRuns:
    """Play `repeats` more repeats than the folder has, and compute a baseline of all.

    `opened` yields the player, once the folder may be extended. Finished repeats that the baseline
    does not have yet count among those to play. Raises BaselineError if there is a baseline already
    and it is not to be extended (`again`), for runs of another bench or programme, and where a run
    is ended early; and what the player raises.
    """
    baseline = _to_extend(folder, plant, programme, bench=bench, again=again, say=say)
    repeats += 0 if baseline is None else baseline.reference.repeats
    with opened as player:
        while (have := len(finished(good_series(folder), programme))) < repeats:
            place = folder_for(folder, "good", programme)
            originals = None if place.name == FIRST else folder / FIRST
            number = int(place.name.removeprefix("good-"))
            if ended := play_series(place, programme, player(number), originals, say):
                raise BaselineError(
                    f"{place.name} is not a repeat of {FIRST}, and is left out: {ended}",
                    value=f"{counted(have, 'repeat')} so far",
                    action="see what changed on the bench, then give the same command again",
                )
        groups = _by_run(finished(good_series(folder), programme), programme)
        reference = commissioned(plant, groups, progress=progress)
        save(Baseline(bench, programme.digest, reference), plant, folder)
    return reference


def in_words(folder: Path, programme: Programme, reference: GoodRuns) -> str:
    """What a baseline holds, in one line."""
    minutes, lacked = programme.duration_s / 60.0, ", ".join(reference.point.effects)
    lacked = f"; the simulator lacked {lacked}" * bool(lacked)
    return (
        f"baseline {folder}: {counted(len(programme.runs), 'run')} of {minutes:.1f} min in all, "
        f"{counted(reference.repeats, 'repeat')} of each{lacked}"
    )


def _to_extend(
    folder: Path, plant: PlantModel, programme: Programme, *, bench: str, again: bool, say: Say
) -> Baseline | None:
    """The baseline of a folder that is to be commissioned; None where it is computed anew."""
    baseline = None
    if (folder / "baseline.json").exists():
        try:
            baseline = load(folder, plant)
        except BaselineError as error:
            say(f"{error.cause}; computed anew from the runs in {folder}")
    if baseline is not None:
        if not again:
            raise BaselineError(
                f"{folder} is a baseline already",
                action="add repeats to it with --again, or give another folder",
            )
        require_same(folder, baseline, bench, programme)
    for place in good_series(folder):
        state = read_state(place)
        if state is not None and state.programme != programme.digest:
            raise BaselineError(
                f"{place} holds runs of another programme",
                value=state.programme[:12],
                limit=programme.digest[:12],
                action=_other_part(state.programme) or "give another folder",
            )
    return baseline


def good_series(folder: Path) -> list[Path]:
    """The folders of the good repeats, in the order in which they were played."""
    folders = (p for p in folder.glob("good-*") if p.name.removeprefix("good-").isdecimal())
    return sorted(folders, key=lambda p: int(p.name.removeprefix("good-")))


def require_same(
    folder: Path, baseline: Baseline, bench: str, programme: Programme, *, part: bool = False
) -> None:
    """Raise BaselineError for a baseline of another bench or programme.

    With `part` some runs of the programme suffice.
    """
    if baseline.bench != bench:
        raise BaselineError(
            f"the baseline {folder} is of another bench",
            value=baseline.bench,
            limit=bench,
            action="give the baseline of this bench",
        )
    allowed = {programme.digest}
    if part:
        allowed |= {shipped().digest, shipped().quick().digest}
    if baseline.programme not in allowed:
        raise BaselineError(
            f"the baseline {folder} is of another programme",
            value=baseline.programme[:12],
            limit=programme.digest[:12],
            action=_other_part(baseline.programme)
            or "give with --programme the one it was recorded with, or commission again",
        )


def _other_part(digest: str) -> str:
    """What to do with runs of a part of the shipped programme; empty for those of another one."""
    if digest == shipped().quick().digest:
        return "add --quick: it holds the quick part only"
    return "leave --quick out: it holds the whole programme" if digest == shipped().digest else ""


def _by_run(places: Sequence[Path], programme: Programme) -> list[list[GapRun]]:
    """The repeats of each run of the programme. Raises PairingError for runs of two boards."""
    repeats = [{f.name: f for f in read_folder(p)} for p in places]
    require_one_bench([f for runs in repeats for f in runs.values()])
    return [
        [replace(runs[run.name].run, name=run.name) for runs in repeats] for run in programme.runs
    ]
