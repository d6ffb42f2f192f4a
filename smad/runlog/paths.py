"""Names of run log files. A file is never overwritten."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path

from smad.errors import RunLogError

SUFFIX = ".mcap"
_LONGEST_NAME = 60


def new_run_path(folder: str | Path, name: str, when: datetime) -> Path:
    """A free path `folder/YYYYMMDD-HHMMSS-name.mcap`; `-2`, `-3`… follow where it is taken."""
    stem = f"{when:%Y%m%d-%H%M%S}-{_file_name(name)}"
    return free_path(Path(folder) / f"{stem}{SUFFIX}")


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


def newest_run(folder: str | Path) -> Path | None:
    """The run log in `folder` whose name says it is the latest, or None."""
    runs = sorted(Path(folder).glob(f"*{SUFFIX}"), key=lambda path: path.name)
    return runs[-1] if runs else None


def _file_name(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:_LONGEST_NAME] or "run"
