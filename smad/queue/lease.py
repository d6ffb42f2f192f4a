"""The lease of the one runner: a lock on a file, which the kernel drops with its processes.

The process of an item inherits the lock. A runner that is killed leaves it to that process until
it has ended, so no second runner begins while an orphan may still use the bench.
"""

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path

from smad.daemon.lockfile import LockFile
from smad.queue.errors import QueueError
from smad.runlog.open_logs import being_written

FILE = "queue.lock"
ORPHAN_PATIENCE_S = 20.0
_POLL_S = 0.1


class RunnerLease(LockFile):
    """The lock of the queue in `folder`. `descriptor` is passed on to the process of an item."""

    error = QueueError

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / FILE, 0o644)

    def acquire(
        self,
        *,
        sleep: Callable[[float], None] = time.sleep,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take the lock; the orphan of a runner that was killed gets time to end.

        Raises QueueError when another runner has it, or the orphan does not end.
        """
        deadline_s = clock_s() + ORPHAN_PATIENCE_S
        while True:
            with contextlib.suppress(BlockingIOError):
                return super().acquire()
            runner = self.process()
            lives = runner > 0 and _alive(runner)
            if lives or clock_s() > deadline_s:
                raise QueueError(
                    "this queue has a runner already"
                    if lives
                    else "an item of a runner that was killed has not ended yet",
                    value=f"process {runner}",
                    action="end it first; nothing was begun",
                )
            sleep(_POLL_S)

    def runs(self) -> bool:
        """Return whether a runner, or an item that it left, has the lock now."""
        with contextlib.suppress(OSError):
            return being_written(self.path)
        return False


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
