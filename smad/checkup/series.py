"""The runs of a programme, played one after the other into a folder.

A log appears under its run's name once the run has ended. An interrupted series continues after the
last finished run.
"""

import contextlib
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from smad.checkup.errors import BaselineError
from smad.checkup.programme import Programme, ProgrammeRun
from smad.errors import SmadError
from smad.files import named_output
from smad.progress import Say
from smad.runlog.header import date_of
from smad.runlog.paths import SUFFIX
from smad.runlog.reader import read_run

_STATE = "series.json"


@dataclass(frozen=True)
class Recorded:
    """Where a run was recorded, and the time it took on the bench with the rest before it.

    `ended` says why it ended early, empty when it did not; `tripped`: by a fault, and not because a
    reading left the run that it repeats.
    """

    path: Path
    ended: str = ""
    tripped: bool = False
    took_s: float = 0.0


Play = Callable[[ProgrammeRun, Path | None], Recorded]
"""Plays a run of the programme as the log of an earlier one has it, or, with None, as designed."""

Player = Callable[[int], Play]
"""Gives what plays a series, by its number, from which a simulated bench draws its noise."""
NOW = 1000
"""The first of the series after the commissioning, whose repeats count from 1."""


class State(msgspec.Struct, frozen=True):
    """`series.json`: the digest of the programme, since when it is played, and how far.

    `done`: it is over; `ended` says why it was ended early.
    """

    programme: str
    began_unix_s: float
    done: bool = False
    ended: str = ""


def folder_for(parent: Path, kind: str, programme: Programme) -> Path:
    """Where the next series of a kind goes: the newest that is not finished, or a new one.

    Raises BaselineError when its folder cannot be written.
    """

    def goes_on(folder: Path) -> bool:
        state = read_state(folder)
        return state is not None and not state.done and state.programme == programme.digest

    folder = newest_open(parent, kind, goes_on)
    if read_state(folder) is None:
        _write(folder, State(programme.digest, time.time()))
    return folder


def newest_open(parent: Path, kind: str, goes_on: Callable[[Path], bool]) -> Path:
    """The newest of the folders `kind-1`, `kind-2` … if it goes on, else the name of the next."""
    tails = (f.name.removeprefix(f"{kind}-") for f in parent.glob(f"{kind}-*"))
    newest = max((int(tail) for tail in tails if tail.isdecimal()), default=0)
    folder = parent / f"{kind}-{newest}"
    return folder if newest and goes_on(folder) else parent / f"{kind}-{newest + 1}"


def read_state(folder: Path) -> State | None:
    """How the series of a folder stands; None where the folder holds none."""
    try:
        return msgspec.json.decode((folder / _STATE).read_bytes(), type=State)
    except (OSError, msgspec.MsgspecError):
        return None


def play_series(
    folder: Path, programme: Programme, play: Play, originals: Path | None, say: Say
) -> str:
    """Play the runs that the folder lacks. Return why the series ended early; empty: it did not.

    `originals` is the folder of the logs that are repeated; None: this is the first time. Raises
    BaselineError for a full disk, and whatever `play` raises; what was finished is kept then.
    """
    state = read_state(folder) or State(programme.digest, time.time())
    played = [run for run in programme.runs if _whole(folder / f"{run.name}.mcap")]
    if played:
        say(f"{folder.name}: goes on after {played[-1].name}, begun {date_of(state.began_unix_s)}")
    for run in programme.runs:
        if run in played:
            continue
        say(f"{folder.name}: {run.name}, {run.duration_s:.0f} s: {run.title}")
        original = None if originals is None else originals / f"{run.name}.mcap"
        try:
            recorded = play(run, original)
        except BaseException:
            count = sum((folder / f"{r.name}.mcap").exists() for r in programme.runs)
            say(
                f"{folder.name}: {count} of {len(programme.runs)} runs are kept; the same command "
                "goes on after them"
            )
            raise
        keep(recorded.path, folder / f"{run.name}.mcap")
        if recorded.ended:
            _write(folder, msgspec.structs.replace(state, done=True, ended=recorded.ended))
            return recorded.ended
    _write(folder, msgspec.structs.replace(state, done=True))
    return ""


def finished(folders: Sequence[Path], programme: Programme) -> list[Path]:
    """The folders that hold every run of the programme, of series that were not ended early."""
    return [
        folder
        for folder in folders
        if all(_whole(folder / f"{run.name}.mcap") for run in programme.runs)
        and not ((state := read_state(folder)) and state.ended)
    ]


def cut_by(log: Path) -> str:
    """What cut a recorded run, "stopped by …"; empty for a run that came to its end.

    Empty also for a file that cannot be read: reading its rows raises the error.
    """
    with contextlib.suppress(SmadError):
        return read_run(log).cut_by if log.suffix.lower() == SUFFIX else ""
    return ""


def _whole(log: Path) -> bool:
    return log.exists() and not cut_by(log)


def keep(log: Path, target: Path) -> None:
    """Copy a log, whole or not at all. Raises BaselineError for a full disk."""
    cause = f"cannot keep the run {target.stem} in {target.parent}"
    action = "make room; the runs before are kept, and the same command goes on"
    with named_output(
        target, BaselineError, cause, action, value=str(log), make_folder=True
    ) as partial:
        shutil.copyfile(log, partial)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file whole or not at all. Raises BaselineError for a full disk."""
    action = "make room, or choose another folder; the same command goes on"
    with named_output(path, BaselineError, action=action, make_folder=True) as partial:
        partial.write_bytes(data)


def _write(folder: Path, state: State) -> None:
    write_whole(folder / _STATE, msgspec.json.encode(state))
