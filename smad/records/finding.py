"""The recorded runs that a word on the command line stands for."""

import glob
from pathlib import Path

from smad.progress import Say
from smad.records.tables import KINDS, is_table
from smad.runlog.paths import SUFFIX, passed_over


def runs_at(text: str, say: Say) -> tuple[list[Path], str]:
    """Return the runs of a file, a folder or a pattern; and, where there are none, what is lacking.

    Of a folder the run logs count, or its tables where it has none; `say` is told what is passed
    over.
    """
    path = Path(text)
    if path.is_file():
        return [path], ""
    if path.is_dir():
        kinds = ", ".join(f"*{kind}" for kind in KINDS)
        lacking = f"folder {text!r} holds no run log (*{SUFFIX}) and no table ({kinds})"
        return _in_folder(path, say), lacking
    matches = sorted(p for p in map(Path, glob.glob(text)) if p.is_file())
    return matches, f"no file, folder or match of a pattern: {text!r}"


def _in_folder(folder: Path, say: Say) -> list[Path]:
    files = sorted(p for p in folder.iterdir() if p.is_file())
    logs = [p for p in files if p.name.lower().endswith(SUFFIX)]
    runs = logs or [p for p in files if is_table(p)]
    if runs and (words := passed_over(folder, files, runs)):
        say(words)
    return runs
