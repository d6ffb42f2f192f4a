"""Names of run log files. A file is never overwritten."""

import contextlib
import re
import unicodedata
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

from smad.counted import counted, listed
from smad.errors import RunLogError, refused_by_system

SUFFIX = ".mcap"
UNNAMED = "run"
"""What a run is called that was given no name."""
_BESIDE = (
    ".header.json",
    ".html",
    ".json",
    ".toml",
    "health.jsonl",
    "queue.lock",
    "queue.sqlite",
    "queue.sqlite-shm",
    "queue.sqlite-wal",
)
"""What smad itself writes beside runs."""
_NAMED = 8
_LONGEST_NAME_BYTES = 60
_STAMP = "%Y%m%d-%H%M%S"
_MOST_SET_BACK = timedelta(days=1)
"""A log whose name is later by more than that is of a clock that was wrong."""


def new_run_path(folder: str | Path, name: str, when: datetime) -> Path:
    """A free path `folder/YYYYMMDD-HHMMSS-name.mcap`, after all that are there in order of names.

    After a log of the same second, or of an hour that the clock was set back, it has the next one.
    Raises RunLogError where the disk does not say what is there.
    """
    first, last = (f"{time:{_STAMP}}" for time in (when, when + _MOST_SET_BACK))
    with refused_by_system(RunLogError, f"cannot look into {folder}", action="check the disk"):
        stamps = (path.name[: len(first)] for path in Path(folder).glob(f"*{SUFFIX}"))
        latest = max((stamp for stamp in stamps if first <= stamp <= last), default="")
        with contextlib.suppress(ValueError):
            when = datetime.strptime(latest, _STAMP) + timedelta(seconds=1)
        return free_path(Path(folder) / f"{when:{_STAMP}}-{_file_name(name)}{SUFFIX}")


def free_path(path: Path) -> Path:
    """`path`, or the first of `stem-2`, `stem-3`… that does not exist."""
    candidate = path
    number = 2
    while candidate.exists():
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return candidate


def make_folder(folder: Path) -> None:
    """Make a folder for run logs, where it is not there yet. Raises RunLogError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        # A name with a NUL is a ValueError.
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise RunLogError(
            f"cannot create folder {folder}: {reason}",
            action="name another folder for the run logs (--folder, or [recorder] folder in the "
            "configuration)",
        ) from error


def part_path(first: Path, part: int) -> Path:
    """The path of part 2, 3… of a run that fills several files."""
    return first.with_name(f"{first.stem}.part{part}{first.suffix}")


def by_time(path: Path) -> tuple[bool, str]:
    """Sort run logs by this: those whose names have no time come first."""
    return re.match(r"\d{8}-\d{6}", path.name) is not None, path.name


def newest_run(folder: str | Path) -> Path:
    """The run log in `folder` whose name says it is the latest. Raises RunLogError: none is."""
    runs = sorted(Path(folder).glob(f"*{SUFFIX}"), key=by_time)
    if not runs:
        raise RunLogError(f"no run logs in {folder}", action="name one, or another --folder")
    return runs[-1]


def names_of(path: Path) -> set[str]:
    """What a person may call the run of a file: its name, with or without suffix, or its path."""
    return {str(path), path.name, path.stem}


def distinct_name(path: Path, among: Sequence[Path]) -> str:
    """A name with as much of the folder as tells two files of one name apart; empty: no need."""
    alike = [p for p in among if p != path and p.name == path.name]
    parts = path.absolute().parts
    for k in range(2, len(parts) + 1):
        if not any(p.absolute().parts[-k:] == parts[-k:] for p in alike):
            return "/".join((*parts[-k:-1], path.stem)) if alike else ""
    return ""


def passed_over(folder: Path, files: Sequence[Path], read: Sequence[Path]) -> str:
    """Which files of a folder are not read, in words; empty where none but smad's own are."""
    passed = [
        str(p.relative_to(folder))
        for p in files
        if p not in read and not p.name.startswith(".") and not p.name.endswith(_BESIDE)
    ]
    if not passed:
        return ""
    return f"{folder}: read {counted(len(read), 'run')}, passed over {listed(passed, _NAMED)}"


def _file_name(name: str) -> str:
    words = re.sub(r"[^\w.-]+", "-", unicodedata.normalize("NFC", name)).strip("-.")
    return cut_to_bytes(words, _LONGEST_NAME_BYTES) or UNNAMED


def cut_to_bytes(name: str, most: int) -> str:
    """The beginning of a name that takes `most` bytes: file systems count these, not letters."""
    return name.encode()[:most].decode(errors="ignore")
