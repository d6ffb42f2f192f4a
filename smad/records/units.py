"""How a column of a file is written, and numbers in its unit as values of a channel. Shape (n,)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.arrays import Array
from smad.errors import LogImportError
from smad.units import alternatives, known


@dataclass(frozen=True)
class Written:
    """How a column stands in its file: value = number · `scale` + `offset`, the number in `unit`.

    `unit` is empty where the file has the unit of the value.
    """

    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def of(cls, unit: str, to: str, scale: float = 1.0, offset: float = 0.0) -> Written:
        """The number · `scale` + `offset` is in `unit`, the value in the unit `to`."""
        zero, unity = convert(np.array([offset, offset + scale]), unit, to).tolist()
        return cls(unit if unit != to else "", unity - zero, zero)

    def numbers(self, values: Array) -> Array:
        """The numbers in the file of values, shape (n,)."""
        return (values - self.offset) / self.scale if self.scale else values

    def values(self, numbers: Array) -> Array:
        """The values of numbers in the file, shape (n,)."""
        return numbers * self.scale + self.offset


def converts(scale: float, offset: float) -> bool:
    """Whether a scale and an offset are those of a unit: a sign alone is not."""
    return (abs(scale), offset) != (1.0, 0.0)


def convert(values: Array, unit: str, to: str) -> Array:
    """`values`, shape (n,), from `unit` to `to`. Raises LogImportError when these do not fit."""
    if unit == to:
        return values
    source, target = known(unit), known(to)
    if source is None or target is None or source.si != target.si:
        raise LogImportError(
            f"{unit} is not a unit for a value in {to}",
            value=unit,
            limit=alternatives(to),
            action="correct the unit",
        )
    return (values * source.scale + (source.offset - target.offset)) / target.scale
