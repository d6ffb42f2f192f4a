"""The lease of the one runner: a lock on a file, which the kernel drops with its processes.

The process of an item inherits the lock. A runner that is killed leaves it to that process until
it has ended, so no second runner begins while an orphan may still use the bench.
"""

import contextlib
import fcntl
import os
import time
from collections.abc import Callable
from pathlib import Path

from smad.errors import refused_by_system
from smad.queue.errors import QueueError
from smad.runlog.open_logs import being_written

FILE = "queue.lock"
ORPHAN_PATIENCE_S = 20.0
_POLL_S = 0.1


class RunnerLease:
    """The lock of the queue in `folder`. `descriptor` is passed on to the process of an item."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        self.descriptor = -1

    def acquire(
        self,
        *,
        sleep: Callable[[float], None] = time.sleep,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take the lock; the orphan of a runner that was killed gets time to end.

        Raises QueueError when another runner has it, or the orphan does not end.
        """
        cause, action = f"cannot use {self.path}", "check the folder's permissions"
        with refused_by_system(QueueError, cause, action=action):
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        deadline_s = clock_s() + ORPHAN_PATIENCE_S
        while not _locked(descriptor):
            runner = self.holder()
            if (runner and _alive(runner)) or clock_s() > deadline_s:
                os.close(descriptor)
                raise QueueError(
                    "this queue has a runner already"
                    if runner and _alive(runner)
                    else "an item of a runner that was killed has not ended yet",
                    value=f"process {runner}",
                    action="end it first; nothing was begun",
                )
            sleep(_POLL_S)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self.descriptor = descriptor

    def holder(self) -> int:
        """Return the process that wrote the file last; 0 when nobody did."""
        with contextlib.suppress(OSError, ValueError):
            return int(self.path.read_text())
        return 0

    def runs(self) -> bool:
        """Return whether a runner, or an item that it left, has the lock now."""
        with contextlib.suppress(OSError):
            return being_written(self.path)
        return False

    def release(self) -> None:
        """Give the lock back."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


def _locked(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _is_zombie(process)


def _is_zombie(process: int) -> bool:
    with contextlib.suppress(OSError, IndexError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    return False
