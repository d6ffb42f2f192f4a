"""A file system of one MiB for a run log, to be filled for real; or the next best thing."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import resource
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_SIZE = b"size=1m,mode=700"
_MNT_DETACH = 2
_PIECES = (65_536, 4096, 1)


@dataclass(frozen=True)
class SmallDisk:
    """A folder that can be filled. `refused` says why it is no file system of its own, if so."""

    folder: Path
    refused: str = ""

    @property
    def text(self) -> str:
        """How it is filled, in words."""
        if self.refused:
            return f"the run log may not grow (a limit on file size: {self.refused})"
        return "the run log's file system is full"

    @property
    def words(self) -> str:
        """What the system says of it."""
        return os.strerror(errno.EFBIG if self.refused else errno.ENOSPC)

    @property
    def _filler(self) -> Path:
        return self.folder / "filler"

    def fill(self, process: int, log: Path) -> None:
        """Leave no room: not a byte on the disk, or none in files of `process` beyond `log`'s."""
        if self.refused:
            size = log.stat().st_size
            resource.prlimit(process, resource.RLIMIT_FSIZE, (size, size))
            return
        # Unbuffered: a buffer would keep what did not fit, and try again at the end.
        with self._filler.open("wb", buffering=0) as file:
            for size in _PIECES:
                with contextlib.suppress(OSError):
                    while file.write(bytes(size)):
                        pass

    def empty(self) -> None:
        """Make room again (a file system of its own only)."""
        self._filler.unlink()


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[SmallDisk]:
    """Mount a small file system at `folder`, which is made, for as long as the block lasts.

    Where mounting is not allowed, the folder is an ordinary one and `refused` says so.
    """
    folder.mkdir(parents=True)
    libc = ctypes.CDLL(None, use_errno=True)
    place = os.fsencode(folder)
    if libc.mount(b"smad-small", place, b"tmpfs", 0, _SIZE) != 0:
        yield SmallDisk(folder, f"mounting is refused, {os.strerror(ctypes.get_errno())}")
        return
    try:
        yield SmallDisk(folder)
    finally:
        # Lazily: whoever still has a file open there must not keep the mount from going.
        libc.umount2(place, _MNT_DETACH)
