"""One decorator for the compiled functions, with a cache that follows *all* of the plant's sources.

Numba's cache looks only at the file of the function itself, so that an edit in a callee's module
would leave a stale caller behind. The cache folder is therefore named after a hash of every file.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., object])


def _sources_digest(folder: Path) -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(folder.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


_FOLDER = Path(__file__).parent
_CACHE = _FOLDER / "__pycache__" / f"compiled-{_sources_digest(_FOLDER)}"


def compiled(function: Function) -> Function:
    """The function compiled by numba on first call, kept on disk for later processes."""
    settings = vars(config)
    before = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = str(_CACHE)
    try:
        return cast(Function, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        settings["CACHE_DIR"] = before
