"""Whether a run log is still being written: its writer holds a lock on it until it ends or dies.

Without the lock, a log that grows and one that a crash cut look the same. Windows has none: there
logs are read, and none is recorded.
"""

import contextlib
from pathlib import Path
from typing import BinaryIO


def mark(file: BinaryIO) -> None:
    """Mark a file as being written, until it is closed or its process ends."""
    # A file system without locks costs the word, not the recording.
    with contextlib.suppress(OSError, ImportError):
        import fcntl

        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


def being_written(path: Path) -> bool:
    """Return whether a running program writes this file. Raises OSError when it cannot be read."""
    with path.open("rb") as file:
        try:
            import fcntl

            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except (OSError, ImportError):
            return False
    return False
