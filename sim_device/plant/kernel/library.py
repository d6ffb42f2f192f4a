"""The kernel's entries from a library of C, which needs no numba and loads at once.

`smad.fmi.library` makes it where a C compiler is: beside the source, and in a wheel. It takes the
records as numpy stores them, so nothing is copied.
"""

from __future__ import annotations

import ctypes
import functools
import inspect
from collections.abc import Callable
from itertools import accumulate
from operator import is_, itemgetter
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np

from firmware_protocol.shared_library import open_library
from sim_device.plant.kernel.layout import is_array

_Function = TypeVar("_Function", bound=Callable[..., Any])

FILE = "kernel.so"
PREFIX = "smad_"
_BYTE = ctypes.c_char.from_buffer
MISSING = "numba is not installed, and this installation of smad has no library of the kernel"


class Library:
    """A library of the kernel whose source has the digest `text`. Raises OSError for any other."""

    def __init__(self, path: Path, text: str) -> None:
        self._library = open_library(path, text, ctypes.CDLL)

    def entry(self, function: _Function) -> _Function:
        """The library's function in place of one of the kernel; raises AttributeError without."""
        call = getattr(self._library, f"{PREFIX}{function.__name__}")
        hints = get_type_hints(function)
        ways = [_WAYS[_kind(hints[name])] for name in inspect.signature(function).parameters]
        call.argtypes = [kind for kinds, _ in ways for kind in kinds]
        call.restype = {float: ctypes.c_double, int: ctypes.c_long}.get(hints["return"])
        arrays = [n for n, (kinds, _) in enumerate(ways) if kinds[0] is ctypes.c_void_p]
        starts = [0, *accumulate(len(kinds) for kinds, _ in ways)]
        scalars = [(n, starts[n], ways[n][1]) for n in range(len(ways)) if n not in arrays]
        picked: Any = itemgetter(*arrays) if len(arrays) > 1 else lambda given: (given[arrays[0]],)
        last: tuple[tuple[Any, ...], list[Any]] = ((), [])

        @functools.wraps(function)
        def called(*arguments: Any) -> Any:
            # A plant calls with the same arrays at every sample: their addresses are kept, and the
            # arrays with them until others come.
            nonlocal last
            given, (known, numbers) = picked(arguments), last
            if not (known and all(map(is_, given, known))):
                pairs = zip(ways, arguments, strict=True)
                numbers = [number for (_, how), value in pairs for number in how(value)]
                last = given, numbers
            numbers = numbers.copy()
            for n, start, how in scalars:
                (numbers[start],) = how(arguments[n])
            return call(*numbers)

        called.py_func = function  # type: ignore[attr-defined]
        return cast(_Function, called)


def _kind(hint: Any) -> str:
    if hint in (int, float):
        return str(hint.__name__)
    return "table" if is_array(hint) else "place"


def _address(array: np.ndarray) -> tuple[int]:
    if not array.flags.c_contiguous:
        raise ValueError("the library takes arrays row by row, without gaps")
    if array.dtype.char == "d" and array.size and array.flags.writeable:
        # Four times as fast as numpy's own way; of records it would describe every field.
        return (ctypes.addressof(_BYTE(array.data)),)
    return (array.ctypes.data,)


def _table(array: np.ndarray) -> tuple[int, ...]:
    return *_address(array), *array.shape


_WAYS: dict[str, tuple[tuple[Any, ...], Callable[[Any], tuple[Any, ...]]]] = {
    "int": ((ctypes.c_long,), lambda value: (int(value),)),
    "float": ((ctypes.c_double,), lambda value: (float(value),)),
    "place": ((ctypes.c_void_p,), _address),
    "table": ((ctypes.c_void_p, ctypes.c_long, ctypes.c_long), _table),
}


def without_numba(function: _Function) -> _Function:
    """What stands for a function where neither a library nor numba is: it says so."""

    @functools.wraps(function)
    def missing(*arguments: Any) -> Any:
        raise ModuleNotFoundError(MISSING, name="numba")

    missing.py_func = function  # type: ignore[attr-defined]
    return cast(_Function, missing)


def shipped(package: Path, text: str) -> Library | None:
    """The library that came with the package, if it was built of this text."""
    try:
        return Library(package / FILE, text)
    except OSError:
        return None
