"""Records with named fields that numpy stores, numba compiles and mypy checks.

A record is declared as a class: `name: float` is a number, `name: Other` a record inside,
`name: Annotated[list[...], n]` n of either. Only numpy arrays of its `dtype_of` are ever made;
the class itself says what is in them, to readers and to mypy.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Dtype = np.dtype[Any]
_NUMBER = np.dtype(np.float64)
OneRecord = Any
"""An array of a single record, as `zeros` makes it: numba takes it faster than the record."""


def is_array(hint: object) -> bool:
    """Whether an annotation is an array of numpy, whose newer versions give it an alias."""
    origin = get_origin(hint)
    return np.ndarray in (origin, get_origin(getattr(origin, "__value__", None)))


@cache
def dtype_of(layout: type) -> Dtype:
    """The numpy type of a record, all float64, fields in the order of the class.

    Raises TypeError for a name that numpy's own scalars have: plain Python would not see the field.
    """
    fields: list[tuple[str, Any, tuple[int, ...]]] = []
    for name, hint in get_type_hints(layout, include_extras=True).items():
        if hasattr(np.record, name):
            raise TypeError(f"{layout.__name__}.{name}: numpy's scalars have {name!r}; rename it")
        kind, shape = hint, ()
        if get_origin(hint) is Annotated:
            (kind,), shape = get_args(hint.__origin__), hint.__metadata__
        fields.append((name, np.float64 if kind is float else dtype_of(kind), shape))
    return np.dtype((np.record, np.dtype(fields, align=True)))


def zeros(layout: type, count: int = 1) -> OneRecord:
    """An array of `count` such records, all zero. An element reads and writes by name."""
    # By way of numbers: numpy makes and copies records field by field, ten times as slowly.
    dtype = dtype_of(layout)
    return _as_records(np.zeros(count * (dtype.itemsize // _NUMBER.itemsize)), dtype)


def _as_records(row: Array, dtype: Dtype) -> OneRecord:
    """The same memory as records. `view` would first compare the types, field by field."""
    return np.ndarray((row.nbytes // dtype.itemsize,), dtype, row)


def numbers(records: OneRecord) -> Array:
    """The same memory as one row of numbers."""
    flat: Array = records.view(_NUMBER)
    return flat


def copied(records: OneRecord) -> OneRecord:
    """A copy of an array of records."""
    return _as_records(numbers(records).copy(), records.dtype)


@cache
def places(layout: type, path: str = "") -> dict[str, int]:
    """Where the single numbers of the record at `path` stand in `numbers` of the layout, by name.

    path: dotted names, "x" for instance; "" is the layout itself. Records and rows inside are left
    out. Raises KeyError for a path that is not there.
    """
    dtype, offset = dtype_of(layout), 0
    for name in path.split(".") if path else ():
        if dtype.fields is None or name not in dtype.fields:
            raise KeyError(f"{layout.__name__} has no record {path!r}")
        dtype, begin = dtype.fields[name][:2]
        offset += begin
    fields = (dtype.fields or {}).items()
    return {
        name: (offset + start) // _NUMBER.itemsize
        for name, (kind, start, *_) in fields
        if kind == _NUMBER
    }


def place_of(layout: type, path: str) -> int:
    """Where one number like "x.T_wire" stands in `numbers` of such a record."""
    record, _, name = path.rpartition(".")
    return places(layout, record)[name]


def fill(row: Array, layout: type, path: str, values: Mapping[str, float]) -> None:
    """Write the single numbers of the record at `path`, all by name, into `numbers` of the layout.

    The record has its single numbers before anything else. Raises TypeError for a number that is
    missing or unknown.
    """
    known = places(layout, path)
    if values.keys() != known.keys():
        odd = ", ".join(sorted(values.keys() ^ known.keys()))
        raise TypeError(f"{layout.__name__} {path}: {odd} missing or unknown")
    first = next(iter(known.values()))
    row[first : first + len(known)] = [values[name] for name in known]


def filled(layout: type, values: Mapping[str, float]) -> OneRecord:
    """An array of one record of single numbers with these values. Raises TypeError as `fill`."""
    records = zeros(layout)
    fill(numbers(records), layout, "", values)
    return records
