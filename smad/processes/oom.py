"""Ask the OOM killer to prefer file readers over the daemon.

Linux ends the process with the highest score. A process may always raise its score; to lower it
takes CAP_SYS_RESOURCE, or a service manager that has it.
"""

from pathlib import Path

FIRST = 800
"""Score of a file reader: its work can be repeated."""

LAST = -800
"""Score of the daemon. Not -1000, which would forbid ending it altogether."""

_SCORE = Path("/proc/self/oom_score_adj")


def score(path: Path = _SCORE) -> int | None:
    """This process's adjustment, -1000 (never ended) to 1000; None where there is no such thing."""
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return None


def prefer_as_oom_victim(path: Path = _SCORE) -> None:
    """Raise this process's score to `FIRST`; a higher score stays. Never raises."""
    now = score(path)
    if now is not None and now < FIRST:
        _write(path, FIRST)


def protect(path: Path = _SCORE) -> int | None:
    """Ask that this process be ended after others; return the adjustment in force."""
    now = score(path)
    if now is not None and now > LAST:
        _write(path, LAST)
    return score(path)


def _write(path: Path, value: int) -> None:
    try:
        path.write_text(f"{value}\n")
    except OSError:
        # Not granted. What is in force is read again by whoever reports it.
        return
