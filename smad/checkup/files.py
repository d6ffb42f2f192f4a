"""Runs from files: run logs, and CSV or Parquet of any bench, and which of them are paired."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from smad.checkup.series import cut_by
from smad.counted import counted
from smad.diagnosis.data.guards import same_recording
from smad.diagnosis.data.rows import grouped, same_programme
from smad.diagnosis.errors import PairingError
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import read_recorded, require_columns
from smad.progress import Say
from smad.records.tables import KINDS
from smad.runlog.bounds import Together

_KINDS = (".mcap", *KINDS)


@dataclass(frozen=True)
class RunFile:
    """A run of a file.

    `board` is the serial number of the board that it was recorded on, empty where the file has
    none. `cut` says what stopped the recording early, empty where nothing did.
    """

    path: Path
    run: GapRun
    board: str = ""
    cut: str = ""

    @property
    def name(self) -> str:
        """The name of the file, without folder and suffixes."""
        return self.path.name.split(".")[0]


def read_folder(folder: Path) -> list[RunFile]:
    """All runs of a folder and its subfolders, by path; links to folders are followed.

    Raises PairingError when there is none.
    """
    if not folder.is_dir():
        raise PairingError(
            f"{folder} is not a folder", action="give the folder that holds the run files"
        )
    paths = sorted(
        p for p in _files_below(folder) if p.is_file() and p.name.lower().endswith(_KINDS)
    )
    if not paths:
        raise PairingError(
            f"{folder} holds no run file", limit=", ".join(_KINDS), action="put the runs there"
        )
    together = Together()
    return [read_file(p, together) for p in paths]


def read_good(folder: Path, say: Say) -> list[RunFile]:
    """All runs of a folder that count as good; those that a stop cut are left out, and named.

    Raises PairingError when that leaves none.
    """
    every_run = read_folder(folder)
    for run in every_run:
        if run.cut:
            say(_left_out(run.path, run.cut))
    whole = [run for run in every_run if not run.cut]
    if not whole:
        raise PairingError(
            f"every run in {folder} was cut",
            limit="runs that came to their end",
            action="play the runs again, and put them there",
        )
    return whole


def whole_runs(good: Sequence[Path], say: Say) -> tuple[Path, ...]:
    """The good runs without those that a stop cut; `say` names each of these."""
    cuts = {path: cut for path in good if (cut := cut_by(path))}
    for path, cut in cuts.items():
        say(_left_out(path, cut))
    return tuple(path for path in good if path not in cuts)


def _left_out(log: Path, cut: str) -> str:
    """The note on a run that is left out of the good ones, since it was cut."""
    return f"{log} was cut ({cut}), and is left out of the good runs"


def _files_below(folder: Path) -> Iterator[Path]:
    """Every file below a folder; links are followed, except to a folder that they lie in."""
    for root, folders, names in os.walk(folder, followlinks=True):
        parent = Path(root)
        above = {parent.resolve(), *parent.resolve().parents}
        folders[:] = [name for name in folders if (parent / name).resolve() not in above]
        yield from (parent / name for name in names)


def read_file(path: Path, together: Together | None = None) -> RunFile:
    """A run of a file; columns are recognised by their names as in `smad log import`.

    `together` counts what is held in memory. Raises RunLogError (also where that is too much),
    LogImportError and GapError, which name the file and what is wrong.
    """
    run, log = read_recorded(path, together)
    if not len(run.t_s):
        raise PairingError(
            f"{path} holds no sample", action="play the run again, or leave the file out"
        )
    require_columns(path, run)
    if log is None:
        return RunFile(path, run)
    return RunFile(path, run, log.header.board.get("uid", ""), log.cut_by)


@dataclass(frozen=True)
class Matched:
    """Good runs by what they repeat, and which of them each run of now repeats, by first name.

    `lines` say in words what was paired with what, and which runs are left out without a partner.
    """

    groups: list[list[GapRun]]
    now: list[tuple[GapRun, str]]
    lines: list[str]


def match(plant: PlantModel, good: Sequence[RunFile], now: Sequence[RunFile]) -> Matched:
    """Pairs files by name where names repeat over folders and inputs agree, else by inputs."""

    def same(run: RunFile, other: RunFile) -> bool:
        return same_programme(plant, run.run, other.run)

    groups = grouped(good, same)
    pairs: list[tuple[RunFile, list[RunFile]]] = []
    alone: list[RunFile] = []
    for run in now:
        fits = [g for g in groups if same(run, g[0])]
        fits.sort(key=lambda g: run.name not in {f.name for f in g})
        if fits:
            pairs.append((run, fits[0]))
        else:
            alone.append(run)
    used = [g for g in groups if any(g is group for _, group in pairs)]
    distinct = len({g[0].name for g in used}) == len(used)
    named = {id(g): g[0].name if distinct else str(g[0].path) for g in used}
    lines = [
        f"{run.path} repeats {counted(len(group), 'good run')}: "
        + ", ".join(str(f.path) for f in group)
        for run, group in pairs
    ]
    lines += [f"{run.path} has the inputs of no good run, and is left out" for run in alone]
    return Matched(
        [[replace(f.run, name=named[id(g)]) for f in g] for g in used],
        [(run.run, named[id(group)]) for run, group in pairs],
        lines,
    )


def require_other_recordings(good: Sequence[RunFile], now: Sequence[RunFile]) -> None:
    """Raise PairingError when a run of now is one of the good ones, or a run was given twice.

    A copy under another name, or written by another exporter, is the same recording.
    """
    runs = [*good, *now]
    for k, run in enumerate(runs):
        same = next((i for i in range(k) if same_recording(runs[i].run, run.run)), None)
        if same is not None:
            path = runs[same].path
            what = f"{run.path} is the same recording as {path}"
            if run.path == path:
                what = f"{path} is given twice"
            elif run.path.resolve() == path.resolve():
                what += ": one is a link to the other"
            raise PairingError(
                what,
                action="give runs of now that are not among the good ones"
                if same < len(good) <= k
                else "leave one out: a copy does not show how a bench varies",
            )


def require_one_bench(runs: Sequence[RunFile]) -> None:
    """Raise PairingError for runs of several boards; files that name no board fit any."""
    boards = {f.board: f.path for f in runs if f.board}
    if len(boards) > 1:
        (board, path), (other, second) = list(boards.items())[:2]
        raise PairingError(
            "runs of two benches are mixed",
            value=f"{path} of board {board}, {second} of board {other}",
            limit="one bench",
            action="take out the runs of the other bench; if only the board was replaced, give CSV "
            "(smad log export), which names no board",
        )
