"""How the kernel is compiled, and where compiled code is kept.

What Python calls comes from a library of C (`library`) where there is one of the present text;
else, as after an edit, numba compiles every function on its first call. Both give the same bits.
SMAD_KERNEL=numba leaves the library out; NUMBA_DISABLE_JIT=1 leaves plain Python.

numba keeps compiled functions by the text of their own file only: a caller in another module would
go on using an old copy of a callee that has been edited. So the folder that they are kept in is
named after the text of all modules of this package, and an edit of any of them begins a new one.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from firmware_protocol.shared_library import digest_of
from sim_device.plant.kernel.library import shipped, without_numba

_Function = TypeVar("_Function", bound=Callable[..., Any])
PACKAGE = Path(__file__).parent
KEPT = 3
"""So many folders stay, the latest ones: who goes back to an earlier text need not compile anew."""


def text_digest(package: Path = PACKAGE) -> str:
    """A name for the present text of all modules of the package."""
    return digest_of(package.glob("*.py"))


_NO_LIBRARY = (
    os.environ.get("SMAD_KERNEL") == "numba" or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"
)
_LIBRARY = None if _NO_LIBRARY else shipped(PACKAGE, text_digest())
njit: Any = None
config: Any = None
DefaultOptions: Any = None
if _LIBRARY is None:
    # numba takes a second to import and to begin.
    with contextlib.suppress(ModuleNotFoundError):
        from numba import njit
        from numba.core import config
        from numba.core.options import DefaultOptions

# Numbers and borrowed arrays only: without `_nrt` every call in the inner loop would count
# references atomically, which doubles the time. The option is numba's own but not documented, so
# it is used where this numba has it.
_FAST: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
# error_model "numpy" leaves out a check of every division; the divisors here cannot be zero. No
# fast-math, so that no operation is reordered or fused.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", **_FAST}

_INTERNAL: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _homes() -> list[Path]:
    """Where cache folders may lie, the best place first."""
    chosen = vars(config)["CACHE_DIR"]
    if chosen:
        return [Path(chosen) / "smad-kernel"]
    digest = hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:12]
    root = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [PACKAGE / "__pycache__", Path(root) / "smad" / digest]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder(homes: list[Path] | None = None) -> Path | None:
    """The folder for compiled code of the present text; None where nothing can be written.

    Made where it is missing: from one that came with a read-only installation if there is one, else
    empty. Folders of earlier texts are removed then, but for the latest.
    """
    homes = _homes() if homes is None else homes
    name = f"kernel-{text_digest()}"
    home = next((home for home in homes if _writable(home)), None)
    if home is None:
        return None
    folder = home / name
    if folder.is_dir():
        return folder if _writable(folder) else None
    shipped = next((other / name for other in homes if (other / name).is_dir()), None)
    if shipped is not None:
        shutil.copytree(shipped, folder, dirs_exist_ok=True)
    folder.mkdir(exist_ok=True)
    earlier = [known for known in home.glob("kernel-*") if known != folder and known.is_dir()]
    earlier.sort(key=lambda known: known.stat().st_mtime)
    for stale in earlier[: max(0, len(earlier) - KEPT + 1)]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder


FOLDER = None if njit is None else cache_folder()


def _made(function: _Function, **options: Any) -> _Function:
    if njit is None:
        return function
    # numba reads the folder when it decorates, and has no other way to be told.
    settings = vars(config)
    before = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = str(FOLDER or "")
    try:
        compiles: Any = njit(cache=FOLDER is not None, **_OPTIONS, **options)
        return cast(_Function, compiles(function))
    finally:
        settings["CACHE_DIR"] = before


def entry(function: _Function) -> _Function:
    """A function that Python calls, as it is compiled here."""
    if _LIBRARY is not None:
        return _LIBRARY.entry(function)
    return without_numba(function) if njit is None else _made(function)


def compiled(function: _Function) -> _Function:
    """Compile a function that only compiled ones call: without what Python would need to."""
    return _made(function, **_INTERNAL)


def inlined(function: _Function) -> _Function:
    """Compile a function of the inner loop into its callers: halves the time of a substep."""
    return _made(function, forceinline=True, **_INTERNAL)
