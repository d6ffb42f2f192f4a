"""The simulated bench as a child process, for `smad start --sim` and the demo."""

import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from smad.errors import DaemonError, PortError
from smad.processes.starting import STALLED_S, StallDetector
from smad.progress import Say

PATIENCE = 60
"""What board and daemon allow each other is so many times longer: a busy computer is no fault."""
PACED = ("--paced-by-host", "--patience", str(PATIENCE))
"""Options of a board, and from the second on of its daemon, that wait for each other."""
READY = "ready: "
"""What the first line of `smad sim` begins with; the port's name follows."""

_END_DEADLINE_S = 10.0
_SEE = "run smad sim by itself to see why"


@contextlib.contextmanager
def simulated_bench(arguments: Sequence[str], symlink: Path, *, waiting: Say) -> Iterator[str]:
    """Run `smad sim` beside us for as long as the block lasts; yields the name of its port.

    `waiting` is told now and then that it is still starting. Raises DaemonError when it ends, or
    does nothing for STALLED_S.
    """
    child = subprocess.Popen(
        [
            *(sys.executable, "-m", "smad", "sim"),
            *("--symlink", str(symlink), "--parent", str(os.getpid())),
            *arguments,
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # ctrl-C goes to the whole group of the terminal; the daemon has to disarm first.
        start_new_session=True,
    )
    try:
        _wait_until_ready(child, waiting)
        try:
            yield str(symlink)
        except PortError as error:
            raise _ended(child) or error from error
    finally:
        child.terminate()
        try:
            child.communicate(timeout=_END_DEADLINE_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.communicate()


def _wait_until_ready(child: subprocess.Popen[str], waiting: Say) -> None:
    assert child.stdout is not None
    stall = StallDetector(child.pid)
    while not stall.stalled():
        waiting("starting the simulated bench (the first time compiles its physics)")
        readable, _, _ = select.select([child.stdout], [], [], 0.5)
        if not readable:
            continue
        if child.stdout.readline().startswith(READY):
            return
        break
    child.kill()
    silence = (
        f"it did nothing for {STALLED_S:g} s" if stall.stalled() else "it ended without a word"
    )
    why = _complaint(child) or silence
    raise DaemonError(f"the simulated bench did not start: {why}", action=_SEE)


def _ended(child: subprocess.Popen[str]) -> DaemonError | None:
    """Return why the bench ended by itself, which takes its port away; None where it did not."""
    try:
        child.wait(_END_DEADLINE_S)
    except subprocess.TimeoutExpired:
        return None
    why = _complaint(child) or f"status {child.returncode}"
    return DaemonError(f"the simulated bench ended: {why}", action=_SEE)


def _complaint(child: subprocess.Popen[str]) -> str:
    _, complaint = child.communicate()
    return "".join(complaint.strip().splitlines()[-1:]).removeprefix("smad: ")
