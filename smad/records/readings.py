"""What in a column is no reading, and what cannot be in the unit that was declared.

Four kinds of samples are taken out: codes that a sensor or a logger writes in place of a reading,
single samples beyond the declared range, jumps that come back within two samples, and stretches in
which a reading stays the same that is noisy beside them, or that moves and then jumps. A column
that is beyond its range otherwise is refused, with the unit that it is likely to be in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from smad.records.units import convert, spelt, units_for

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

CODES = (
    -127.0, 85.0, 999.0, -999.0, 999.9, -999.9, 9999.0, -9999.0, 9999.9, -9999.9, 99999.0, -99999.0,
    32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, -273.15,
)  # fmt: skip
"""What sensors and loggers write for "no reading"; -127 and 85 °C are a DS18B20's."""
_HUGE = 1e9
BEYOND = 0.02
"""Of a range, by which noise may carry a reading beyond its ends."""
_JUMP, _JUMP_TIMES = 0.05, 20.0
"""A jump is more than a twentieth of the range, and than so many usual steps."""
_FEW, _SHORT = 0.01, 3
"""Samples beyond a range that are so few, and so short, are no other unit."""
_BITS = (8, 10, 12, 14, 16)
STUCK_SAMPLES, STUCK_CHANCE = 10, 1e-9
"""A reading that stays the same for so many samples, and would by chance so seldom, is stuck."""
_LEAP, _LEAP_CHANCE = 3.0, 1e-4
"""Times the largest step beside a stretch, that a reading jumps by where it was stuck; with that it
may stay the same by chance so often."""
_LEVELS = 5
"""Values that a reading takes beside a stretch, at least: one with fewer may have no noise."""


@dataclass(frozen=True, kw_only=True)
class Declared:
    """What a column is declared to be; `applied`: an input, which may step as it likes."""

    name: str
    unit: str
    low: float
    high: float
    applied: bool = False

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


@dataclass(frozen=True)
class Checked:
    """A column with NaN where a sample is no reading.

    `notes` say in words what was taken out, `refusal` why the column cannot be what it is declared
    to be; empty where it can. `share` of its samples was taken out.
    """

    values: Array
    notes: tuple[str, ...]
    refusal: str
    share: float


def checked(values: Array, declared: Declared, t_s: Array, steady: Mask | None = None) -> Checked:
    """Check one column, shape (n,), NaN where nothing was recorded.

    `steady` (n,): where no input steps nearby; only there a jump that comes back is no reading.
    """
    known = np.isfinite(values)
    if not known.any():
        return Checked(values, (), "", 0.0)
    notes, bad = [], np.zeros(len(values), dtype=bool)
    codes = _codes(values, known, declared)
    for code in np.unique(values[codes]):
        coded = codes & (values == code)
        notes.append(
            f"{declared.name} holds {code:g} in {_samples(coded, t_s)}: a code, no reading"
        )
    bad |= codes
    rest = known & ~bad & declared.beyond(values)
    if rest.any():
        if np.mean(rest) > _FEW or _longest(rest) > _SHORT:
            return Checked(values, tuple(notes), _refusal(values[known & ~bad], declared), 0.0)
        worst = values[rest][np.argmax(np.abs(values[rest]))]
        notes.append(
            f"{declared.name} is beyond {declared.range_words} in {_samples(rest, t_s)}, "
            f"up to {worst:g}"
        )
        bad |= rest
    if not declared.applied and steady is not None:
        jumps = _jumps(values, known & ~bad, declared) & steady
        if jumps.any():
            notes.append(
                f"{declared.name} jumps and comes back at once in {_samples(jumps, t_s)}, "
                f"first to {values[jumps][0]:g}"
            )
            bad |= jumps
    if not declared.applied:
        for stays, how in _stuck(values, known & ~bad, steady):
            notes.append(
                f"{declared.name} stays at {values[stays[0]]:g} for {len(stays)} samples (from "
                f"{t_s[stays[0]]:.6g} to {t_s[stays[-1]]:.6g} s) and {how}: stuck"
            )
            bad[stays] = True
    share = float(np.sum(bad) / np.sum(known))
    return Checked(np.where(bad, np.nan, values), tuple(notes), "", share)


def _codes(values: Array, known: Mask, declared: Declared) -> Mask:
    """Samples that are codes: beyond the range, or within it but far from their neighbours."""
    beyond = known & declared.beyond(values)
    codes = np.isin(values, CODES) & known
    coded = (codes | (np.abs(values) >= _HUGE)) & beyond
    if declared.applied:
        return np.asarray(coded)
    others = beyond & ~coded
    if others.any() and np.ptp(values[others]) == 0.0 and np.mean(beyond) < 0.5:
        coded |= others
    power_on = known & (values == 85.0) & ~beyond & (spelt(declared.unit) == "degC")
    if power_on.any() and not power_on[known & ~coded].all():
        coded |= power_on & _far(values, known & ~coded & ~power_on, declared)
    return np.asarray(coded)


def _far(values: Array, good: Mask, declared: Declared) -> Mask:
    """Which values are far from a straight line between the good ones around them."""
    index = np.arange(len(values))
    around = np.interp(index, index[good], values[good])
    return np.abs(values - around) > _least_jump(values[good], declared)


def _least_jump(good: Array, declared: Declared) -> float:
    usual = float(np.quantile(np.abs(np.diff(good)), 0.99)) if len(good) > 1 else 0.0
    return max(_JUMP * declared.span, _JUMP_TIMES * usual)


def _jumps(values: Array, good: Mask, declared: Declared) -> Mask:
    """Samples of jumps that come back within two samples."""
    index = np.flatnonzero(good)
    out = np.zeros(len(values), dtype=bool)
    if len(index) > 5:
        y = values[index]
        windows = sliding_window_view(np.pad(y, 2, "edge"), 5)
        out[index] = np.abs(y - np.median(windows, axis=1)) > _least_jump(y, declared)
    return out


def _stuck(values: Array, good: Mask, steady: Mask | None) -> list[tuple[Index, str]]:
    """Samples of each stretch in which a reading is stuck, and how that is known.

    It is noisy on both sides; or it moves on both, and jumps afterwards although no input steps. A
    reading at its lowest or highest may be clipped, one at 0 off, and one without noise at rest:
    these are not stuck.
    """
    index = np.flatnonzero(good)
    y = values[index]
    out = []
    for start, stop in _same(y):
        n = stop - start
        if n < STUCK_SAMPLES or y[start] in (0.0, y.min(), y.max()):
            continue
        before, after = y[max(0, start - 2 * n) : start], y[stop : stop + 2 * n]
        sides = [side for side in (before, after) if len(side) >= STUCK_SAMPLES]
        same = [(np.sum(np.diff(side) == 0.0) + 1.0) / (len(side) + 1.0) for side in sides]
        chance = max(same, default=1.0) ** (n - 1)
        if chance < STUCK_CHANCE and all(_noisy(side) for side in sides):
            out.append((index[start:stop], "is noisy beside them"))
        elif (
            len(sides) == 2 and chance < _LEAP_CHANCE and steady is not None and steady[index[stop]]
        ):
            usual = max(np.abs(np.diff(side)).max() for side in sides)
            if abs(y[stop] - y[stop - 1]) > _LEAP * usual:
                out.append((index[start:stop], "jumps afterwards"))
    return out


def _same(y: Array) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of each stretch of equal values."""
    same = np.diff(y, prepend=np.nan) == 0.0
    edges = np.flatnonzero(np.diff(np.r_[False, same, False].astype(int)))
    return [(int(a) - 1, int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def longest_same(y: Array) -> tuple[int, int]:
    """First sample, and the one after the last, of the longest stretch of equal values."""
    return max(_same(y), key=lambda ends: ends[1] - ends[0], default=(0, min(1, len(y))))


def _noisy(side: Array) -> bool:
    """Whether values go up and down as noise does, over more than a few levels."""
    turns = np.diff(np.sign(np.diff(side)[np.diff(side) != 0.0]))
    often = len(turns) > 0 and float(np.mean(turns != 0)) > 1.0 / 3.0
    return often and len(np.unique(side)) >= _LEVELS


def _longest(mask: Mask) -> int:
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _samples(mask: Mask, t_s: Array) -> str:
    count = int(np.sum(mask))
    first = f"{t_s[np.argmax(mask)]:.6g} s"
    return f"one sample (at {first})" if count == 1 else f"{count} samples (the first at {first})"


def _refusal(values: Array, declared: Declared) -> str:
    low, high = float(values.min()), float(values.max())
    likely = likely_unit(values, declared)
    return f"{declared.name} holds {low:.6g} to {high:.6g}, declared {declared.range_words}: " + (
        likely or "correct the column, its unit, or the range that is declared"
    )


def likely_unit(values: Array, declared: Declared) -> str:
    """What values beyond the range are likely to be, and what to do; empty: nothing known.

    The likeliest is the conversion that brings them into the range and leaves them largest.
    """
    low, high = float(values.min()), float(values.max())
    unit = spelt(declared.unit) or "1"
    spreads: dict[str, float] = {}
    for other in units_for(unit):
        there = convert(np.array([low, high]), other, unit)
        small = np.max(np.abs(there)) <= BEYOND * declared.span
        if other != unit and not small and not declared.beyond(there).any():
            spreads[_in_unit(other, declared)] = float(np.max(np.abs(there)))
    bits = next((b for b in _BITS if high < 2**b), 0)
    if bits and low >= 0.0 == declared.low and np.all(values == np.rint(values)):
        scale = declared.high / (2**bits - 1)
        give = f"`scale = {scale:.6g}`" if declared.applied else f"what makes them {declared.unit}"
        spreads[f"counts of {bits} bits? give {give}"] = high * scale
    if low < 0.0 and not declared.beyond(-values).any():
        spreads["is its sign reversed? give `scale = -1`"] = -low
    if spreads:
        return max(spreads, key=lambda words: spreads[words])
    if low < 0.0 <= declared.low:
        return "does it go both ways? declare its range so, or correct its sign"
    return ""


def _in_unit(unit: str, declared: Declared) -> str:
    """The words for values that are in another unit of the table."""
    if unit == "pct" and declared.high == 1.0:
        return "percent? give `scale = 0.01`"
    return f"in {unit}? say so, in the name of its column or by `column_unit` in a map"
