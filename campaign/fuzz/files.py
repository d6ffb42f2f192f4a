"""A folder of this process for what a harness has to put into files; removed when it ends."""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
from pathlib import Path

_MEMORY = Path("/dev/shm")


@functools.cache
def folder() -> Path:
    """Return the folder, in memory where there is such a file system."""
    made = Path(tempfile.mkdtemp(prefix="smad-fuzz-", dir=_MEMORY if _MEMORY.is_dir() else None))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def file_with(name: str, data: bytes) -> Path:
    """Return a file of that name that holds `data`; one of an earlier input is replaced."""
    path = folder() / name
    path.write_bytes(data)
    return path


def no_file(name: str) -> Path:
    """Return a path of that name at which there is nothing."""
    path = folder() / name
    path.unlink(missing_ok=True)
    return path
