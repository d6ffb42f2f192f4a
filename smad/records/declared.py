"""What a column is declared to be, and the likely unit of values beyond its range."""

from dataclasses import dataclass, field

import numpy as np

from smad.arrays import Array, Mask
from smad.records.units import Written, convert
from smad.units import spelt, units_for

BEYOND = 0.02
"""Of a range, by which noise may carry a reading beyond its ends."""
_BITS = (8, 10, 12, 14, 16)


@dataclass(frozen=True, kw_only=True)
class Declared:
    """What a column is declared to be; `applied`: an input, which may step as it likes.

    `written` says how it stands in its file.
    """

    name: str
    unit: str
    low: float
    high: float
    applied: bool = False
    written: Written = field(default_factory=Written)

    @property
    def file_unit(self) -> str:
        """The unit of the numbers in the file."""
        return spelt(self.written.unit or self.unit)

    def number(self, value: float) -> str:
        """A value as it stands in the file, with its unit there if that is another."""
        number = float(self.written.numbers(np.array([value]))[0])
        return f"{number:.6g} {self.written.unit}".rstrip()

    @property
    def span(self) -> float:
        """Width of the range."""
        return self.high - self.low

    def beyond(self, values: Array) -> Mask:
        """Which values are beyond the range by more than noise."""
        room = BEYOND * self.span
        return np.asarray((values < self.low - room) | (values > self.high + room))

    @property
    def range_words(self) -> str:
        """The range as people read it."""
        return f"{self.low:g} to {self.high:g}{'' if self.unit in ('', '1') else ' ' + self.unit}"


def refusal_words(values: Array, declared: Declared) -> str:
    ends = np.array([values.min(), values.max()])
    numbers = sorted(declared.written.numbers(ends).tolist())
    read = f" {declared.written.unit}" if declared.written.unit else ""
    return (
        f"{declared.name} holds {numbers[0]:.6g} to {numbers[1]:.6g}{read}, declared "
        f"{declared.range_words}: "
    ) + (
        likely_unit(values, declared)
        or "correct the column, its unit, or the range that is declared"
    )


def likely_unit(values: Array, declared: Declared) -> str:
    """What values beyond the range are likely to be, and what to do; empty: nothing known.

    The likeliest is the conversion that brings them into the range and leaves them largest.
    """
    low, numbers = float(values.min()), declared.written.numbers(values)
    unit = spelt(declared.unit) or "1"
    spreads: dict[str, float] = {}
    for other in units_for(unit):
        converted = convert(np.array([numbers.min(), numbers.max()]), other, unit)
        small = np.max(np.abs(converted)) <= BEYOND * declared.span
        if other != declared.file_unit and not small and not declared.beyond(converted).any():
            spreads[_in_unit(other, declared)] = float(np.max(np.abs(converted)))
    bits = next((b for b in _BITS if numbers.max() < 2**b), 0)
    if bits and low >= 0.0 == declared.low and np.all(numbers == np.rint(numbers)):
        scale = declared.high / (2**bits - 1)
        in_map = f"`scale = {scale:.6g}` in a map"
        give = in_map if declared.applied else f"what makes them {declared.unit}"
        spreads[f"counts of {bits} bits? give {give}"] = numbers.max() * scale
    signed = unit not in units_for("K")
    if signed and low < 0.0 and not declared.beyond(-values).any():
        spreads["is its sign reversed? give `scale = -1` in a map"] = -low
    if spreads:
        return max(spreads, key=lambda words: spreads[words])
    if low < 0.0 <= declared.low:
        return "does it go both ways? declare its range so, or correct its sign"
    return ""


def _in_unit(unit: str, declared: Declared) -> str:
    """The words for values that are in another unit of the table."""
    if unit == "pct" and declared.high == 1.0:
        return "percent? give `scale = 0.01` in a map"
    return f"in {unit}? say so, in the name of its column or by `column_unit` in a map"
