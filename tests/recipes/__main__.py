"""The six main tasks as the pages show them, command by command: python -m tests.recipes [TASK…]

Prints how many seconds the commands of each task take on the simulated bench. Exit status 1 where
one fails.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.docs.pages import read_page
from tests.docs.test_commands import ROOT, reader_in, run_page

TASKS = {
    "session": ("a first session: arm, move, record, export", "README.md"),
    "drive": ("drive the bench", "docs/guide/daemon.md"),
    "runs": ("keep, read, export and recover runs", "docs/guide/run-logs.md"),
    "experiment": ("repeat an experiment of the paper", "docs/experiments/README.md"),
    "gap": ("find out why simulator and bench disagree", "docs/guide/diagnose-a-gap.md"),
    "check-up": ("find out what has changed on a bench", "docs/guide/check-up.md"),
}
"""Name of a task → what it is, and the page that shows its commands."""


def seconds_of(task: str) -> float:
    """Return how long the commands of a task take. Raises AssertionError where one fails."""
    with tempfile.TemporaryDirectory(prefix="smad-task-") as folder:
        env = reader_in(Path(folder))
        work = Path(folder) / "work"
        work.mkdir()
        began_s = time.monotonic()
        run_page(read_page(ROOT / TASKS[task][1]), work, env)
        return time.monotonic() - began_s


def main(names: Sequence[str]) -> int:
    """Run the tasks of these names, or all; return 1 where one fails."""
    unknown = [name for name in names if name not in TASKS]
    if unknown:
        print(f"there is no task {unknown[0]!r}; there are {', '.join(TASKS)}")
        return 1
    failed = False
    for task in names or TASKS:
        text, page = TASKS[task]
        try:
            took = f"{seconds_of(task):6.1f} s"
        except AssertionError as error:
            failed, took = True, f"failed: {error}"
        print(f"{task:<11} {took}  {text} ({page})", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
