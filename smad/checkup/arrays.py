"""The arrays of a baseline's file: bounded by what their headers say, before one of them is read.

A file of a few megabytes may claim gigabytes of zeros, text in place of numbers, or arrays that do
not fit each other; it comes from a folder that anybody may have written.
"""

import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from smad.runlog.bounds import MOST_ARRAYS, MOST_ARRAYS_BYTES

_KINDS = {"floats": "f", "whole numbers": "iu", "yes or no": "b"}


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an `.npz` file by name.

    Raises ValueError for arrays of something else than numbers, and for more or larger ones than a
    baseline has; and what opening and unpacking raise.
    """
    arrays = {}
    bytes_left = MOST_ARRAYS_BYTES
    with zipfile.ZipFile(path) as packed:
        members = packed.namelist()
        if len(members) > MOST_ARRAYS or len(set(members)) < len(members):
            raise ValueError(f"{len(members)} arrays, allowed: {MOST_ARRAYS} of different names")
        for member in members:
            with packed.open(member) as file:
                shape, dtype = _header(member, file)
            bytes_left -= prod(shape) * dtype.itemsize
            if bytes_left < 0:
                raise ValueError(
                    f"its arrays are more than {MOST_ARRAYS_BYTES} bytes, too many for a baseline "
                    f"({member} claims {shape})"
                )
        for member in members:
            with packed.open(member) as file:
                arrays[member.removesuffix(".npy")] = npy.read_array(file, allow_pickle=False)
    return arrays


def _header(member: str, file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read is None:
        raise ValueError(f"{member} is of an unknown version {version}")
    shape, _, dtype = read(file)
    if dtype.kind not in "fiub" or dtype.itemsize > 8 or any(n < 0 for n in shape):
        raise ValueError(f"{member} holds {dtype} of shape {shape}, no numbers")
    return shape, dtype


def require(
    arrays: Mapping[str, np.ndarray],
    name: str,
    shape: tuple[int, ...],
    kind: str,
    *,
    least: float = -np.inf,
    above: float = -np.inf,
    below: float = np.inf,
) -> None:
    """Raise ValueError for an array of another shape (−1: any length) or kind, and for a number
    that is not finite or out of range; KeyError for an array that is absent."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        want in (-1, n) for n, want in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in _KINDS[kind]:
        raise ValueError(
            f"{name} holds {array.dtype} of shape {array.shape}, allowed: {kind} of {shape}"
        )
    wrong = array[~(np.isfinite(array) & (array >= least) & (array < below))]
    wrong = wrong if len(wrong) else array[array <= above]
    if len(wrong):
        raise ValueError(f"{name} holds {wrong[0]}, which it cannot be")
