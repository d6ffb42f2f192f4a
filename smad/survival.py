"""Who is ended first when the machine runs out of memory: whoever reads files, never the daemon.

Linux ends the process with the highest score. A process may raise its own at any time; to lower it
takes CAP_SYS_RESOURCE, or a service manager that has it.
"""

from __future__ import annotations

from pathlib import Path

FIRST = 800
"""Of what reads files: such work can be done again."""

LAST = -800
"""Of the daemon. Not the least there is, which would forbid ending it altogether."""

_SCORE = Path("/proc/self/oom_score_adj")


def score(path: Path = _SCORE) -> int | None:
    """This process's adjustment, -1000 (never ended) to 1000; None where there is no such thing."""
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return None


def volunteer(path: Path = _SCORE) -> None:
    """Let this process be ended before others. Never raises; a score that is higher stays."""
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
