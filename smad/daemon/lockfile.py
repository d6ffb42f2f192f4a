"""Lock files: one daemon to a port, one daemon to a bench name, one runner to a queue.

The kernel drops an flock with its process, so nothing is left over after a crash; the file itself
stays, and says who holds it.
"""

import contextlib
import fcntl
import os
from pathlib import Path

from smad.errors import DaemonError, PortError, SmadError, refused_by_system

_SHARED_FOLDERS = (Path("/run/lock"), Path("/var/lock"))


class LockFile:
    """An exclusive flock on a file, held until `release()` or the end of the process.

    A process that inherits its `descriptor` (-1: not held) holds it, too.
    """

    error: type[SmadError] = DaemonError

    def __init__(self, path: Path, mode: int = 0o666) -> None:
        self.path = path
        self._mode = mode
        self.descriptor = -1

    def acquire(self) -> None:
        """Take the lock at once or not at all.

        Raises `BlockingIOError` when another process holds it (`holder()` says which), and
        `error` when the file cannot be used.
        """
        action = "check the folder's permissions, or remove a stale file"
        with refused_by_system(self.error, f"cannot use the lock file {self.path}", action=action):
            fd = _open(self.path, self._mode)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(fd)
            raise
        with contextlib.suppress(OSError):
            os.ftruncate(fd, 0)
            os.pwrite(fd, f"{os.getpid()}\n".encode(), 0)
        self.descriptor = fd

    def take_again(self) -> None:
        """Take the lock on the file that has the name now; the old one was deleted or moved.

        Raises as `acquire` does, and holds the old one then.
        """
        before, self.descriptor = self.descriptor, -1
        try:
            self.acquire()
        except BaseException:
            self.descriptor = before
            raise
        if before >= 0:
            os.close(before)

    def holder(self) -> str:
        """Return who wrote the file last, as `process 123`, for a message."""
        process = self.process()
        return f"process {process}" if process else "another process"

    def process(self) -> int:
        """Return the number of the process that wrote the file last; 0 when nobody did."""
        with contextlib.suppress(OSError, ValueError):
            return int(self.path.read_text())
        return 0

    def release(self) -> None:
        """Give the lock back; does nothing when it is not held."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


class PortLock(LockFile):
    """The lock of a port. One that cannot be had now is tried again, as the port is."""

    error = PortError


def port_lock(device: int) -> PortLock:
    """Return the lock of a serial device, by its device number: every name of it is one port."""
    name = f"smad-tty-{os.major(device)}-{os.minor(device)}.lock"
    for folder in _SHARED_FOLDERS:
        if os.access(folder, os.W_OK):
            return PortLock(folder / name)
    return PortLock(Path("/tmp") / name)


def _open(path: Path, mode: int) -> int:
    flags = os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | flags, mode)
    except PermissionError:
        # Another user's file in a sticky folder: a lock needs no more than reading.
        return os.open(path, os.O_RDONLY | flags)
    return fd
