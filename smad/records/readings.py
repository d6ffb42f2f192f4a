"""What in a column is no reading, and what cannot be in the unit that was declared.

Five kinds of samples are taken out: codes that a sensor or a logger writes in place of a reading
(looked for among the numbers of the file, too, before units are converted), single samples beyond
the declared range, jumps that come back within two samples, stretches at another value to which a
reading leaps and comes back, and stretches in which a reading stays the same that is noisy beside
them, or that moves and then jumps. A column that is beyond its range otherwise is refused, with the
unit that it is likely to be in. A reading that several rows each repeat is named.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from sim_device.plant.units import UNITS
from smad.arrays import Array, Index, Mask
from smad.counted import listed
from smad.records.declared import Declared, refusal_words
from smad.units import spelt

CODES = (
    -127.0, 85.0, 999.0, -999.0, 999.9, -999.9, 9999.0, -9999.0, 9999.9, -9999.9, 99999.0, -99999.0,
    32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, -273.15,
)  # fmt: skip
"""What sensors and loggers write for "no reading"; -127 and 85 °C are a DS18B20's."""
_POWER_ON = 85.0
_HUGE, _DIGITS = 1e9, 6
_JUMP, _JUMP_TIMES, _USUAL = 0.05, 20.0, 0.95
"""A jump is more than a twentieth of the range, and than so many steps that few exceed."""
_DROPPED = 0.05
"""Of a run, that a reading may be at a value which it leaps to and comes back from."""
_FEW, _SHORT = 0.01, 3
"""Samples beyond a range that are so few, and so short, are no other unit."""
STUCK_SAMPLES, STUCK_CHANCE = 10, 1e-9
"""A reading that stays the same for so many samples, and would by chance so seldom, is stuck."""
_LEAP, _LEAP_CHANCE = 3.0, 1e-4
"""Times the largest step beside a stretch, that a reading jumps by where it was stuck; with that it
may stay the same by chance so often."""
_STEP, _NEAR = 0.05, 5
"""An input steps by more than this of its range; so many samples around it a reading may jump."""
_MOST_MISSING, _MOST_UNKNOWN = 0.2, 0.5
"""Of a reading's samples, that may be missing; of an input's, that was not logged on change."""
_HOLD = (
    "if it was logged on change, or slower than the rest, fill in what is between its numbers "
    "(`hold = true` for it in a map)"
)
_OPEN = "is its sensor open?"
_AT_ONCE = 0.5
"""Of the samples that a reading lacks, that a slower or rarer log does not lack in one piece."""
_LISTED = 3
"""Columns that a remark names."""
_CHANGES, _REGULAR, _STEPS = 20, 0.9, 0.2
"""A reading that rows repeat changes so often, at so many changes after as many rows as usual, and
by more than one quantum in so many."""
_WITH_INPUT = 0.3
"""Of its changes, beyond chance, that may go with one of an input: that does step so."""
_LEVELS = 5
"""Values that a reading takes beside a stretch, at least: one with fewer may have no noise."""


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


@dataclass(frozen=True)
class Remark:
    """What is wrong with a column, and what to do about it (`advice`).

    `kind` is "gaps" (of all columns together, `name` empty), "no reading", "out of range",
    "repeated" (each reading in so many `rows`), "sparse" or "empty".
    """

    kind: str
    name: str
    text: str
    advice: str = ""
    rows: int = 1


def checked_columns(
    columns: Mapping[str, Array],
    declared: Sequence[Declared],
    t_s: Array,
    steady: Mask | None = None,
) -> tuple[dict[str, Array], list[Remark]]:
    """The columns, shape (n,) each, NaN where a sample is no reading, and what to remark on them.

    Those that are not `declared` stay as they are. `steady` (n,): where no input steps nearby, by
    default where none of these does; only there a jump that comes back is no reading.
    """
    out = {n: np.asarray(c, dtype=np.float64) for n, c in columns.items()}
    n, remarks = len(t_s), list[Remark]()
    gaps = {name: ~np.isfinite(c) for name, c in out.items()}
    few = {name: g for name, g in gaps.items() if 0 < np.sum(g) <= _MOST_MISSING * n}
    if few:
        count = int(np.sum(np.logical_or.reduce(list(few.values()))))
        text = f"{listed([*few], _LISTED)} without a number in {count} of {n} samples"
        remarks.append(Remark("gaps", "", text))
    declared = [d for d in declared if d.name in out]
    steady = _steady(out, declared) if steady is None else steady
    changing = np.zeros(n, dtype=bool)
    for d in (d for d in declared if d.applied):
        changing |= np.diff(out[d.name], prepend=np.nan) != 0.0
    for d in declared:
        column = checked(out[d.name], d, t_s, steady)
        out[d.name] = column.values
        remarks += [Remark("no reading", d.name, note) for note in column.notes]
        if column.refusal:
            remarks.append(Remark("out of range", d.name, column.refusal))
        rows = 1 if d.applied else rows_each(column.values, steady, changing)
        if rows > 1:
            text = f"{d.name} repeats each value in {rows} rows: it is slower than the rest"
            remarks.append(Remark("repeated", d.name, text, rows=rows))
        readings = int(np.sum(np.isfinite(column.values)))
        least = 1.0 - (_MOST_UNKNOWN if d.applied else _MOST_MISSING)
        if not readings:
            remarks.append(Remark("empty", d.name, f"{d.name} holds no number"))
        elif readings < least * n:
            text = f"{d.name} holds a reading in {readings} of {n} samples only "
            text += f"({math.ceil(least * n)} are needed)"
            missing = ~np.isfinite(column.values)
            at_once = _longest(missing) > _AT_ONCE * np.sum(missing)
            open_ = not d.applied and (column.share > _MOST_MISSING or at_once)
            advice = _OPEN if open_ else _HOLD
            remarks.append(Remark("sparse", d.name, text, advice))
    return out, remarks


def _steady(columns: Mapping[str, Array], declared: Sequence[Declared]) -> Mask:
    """Where no input steps within a few samples, shape (n,)."""
    n = len(next(iter(columns.values()), ()))
    if not n:
        return np.zeros(0, dtype=bool)
    stepping = np.zeros(n, dtype=bool)
    for d in (d for d in declared if d.applied):
        steps = np.abs(np.diff(columns[d.name], prepend=columns[d.name][:1]))
        stepping |= ~(steps <= _STEP * d.span)
    near = np.convolve(stepping, np.ones(2 * _NEAR + 1))[_NEAR : _NEAR + n]
    return np.asarray(near < 0.5)


def checked(values: Array, declared: Declared, t_s: Array, steady: Mask | None = None) -> Checked:
    """Check one column, shape (n,), NaN where nothing was recorded.

    `steady` (n,): where no input steps nearby; only there a jump that comes back is no reading.
    """
    finite = np.isfinite(values)
    if not finite.any():
        return Checked(values, (), "", 0.0)
    notes, bad = [], np.zeros(len(values), dtype=bool)
    steady = np.zeros(len(values), dtype=bool) if steady is None else steady
    codes = _codes(values, finite, declared)
    rest = finite & ~codes & declared.beyond(values)
    if _too_many(rest):
        # In another unit any number may stand for a reading.
        return Checked(values, (), refusal_words(values[finite & ~codes], declared), 0.0)
    for code in np.unique(values[codes]):
        coded = codes & (values == code)
        notes.append(
            f"{declared.name} holds {declared.number(code)} in {_samples(coded, t_s)}: "
            "a code, no reading"
        )
    bad |= codes
    if rest.any():
        worst = values[rest][np.argmax(np.abs(values[rest]))]
        notes.append(
            f"{declared.name} is beyond {declared.range_words} in {_samples(rest, t_s)}, "
            f"up to {declared.number(worst)}"
        )
        bad |= rest
    if not declared.applied:
        jumps = _jumps(values, finite & ~bad, declared) & steady
        if jumps.any():
            notes.append(
                f"{declared.name} jumps and comes back at once in {_samples(jumps, t_s)}, "
                f"first to {declared.number(values[jumps][0])}"
            )
            bad |= jumps
    if not declared.applied:
        for stays, how in _stuck(values, finite & ~bad, steady, declared):
            notes.append(
                f"{declared.name} stays at {declared.number(values[stays[0]])} for {len(stays)} "
                f"samples (from {t_s[stays[0]]:.6g} to {t_s[stays[-1]]:.6g} s){how}"
            )
            bad[stays] = True
    share = float(np.sum(bad) / np.sum(finite))
    return Checked(np.where(bad, np.nan, values), tuple(notes), "", share)


def beyond_range(values: Array, declared: Declared) -> bool:
    """Whether values, shape (n,), are beyond the range in more than a few samples."""
    return _too_many(np.isfinite(values) & declared.beyond(values))


def _too_many(beyond: Mask) -> bool:
    return bool(np.mean(beyond) > _FEW or _longest(beyond) > _SHORT)


def _codes(values: Array, finite: Mask, declared: Declared) -> Mask:
    """Samples that are codes: beyond the range, or within it but far from their neighbours."""
    beyond = finite & declared.beyond(values)
    numbers = declared.written.numbers(values)
    # A sensor writes its code in its unit, a logger in that of the file.
    forms = ((numbers, declared.file_unit), (values, spelt(declared.unit)))
    codes = finite & np.logical_or.reduce([np.isin(_rounded(x), CODES) for x, _ in forms])
    coded = (codes | (np.abs(numbers) >= _HUGE)) & beyond
    if declared.applied:
        return np.asarray(coded)
    uncoded = beyond & ~coded
    if np.sum(uncoded) > 1 and np.ptp(values[uncoded]) == 0.0 and np.mean(beyond) < 0.5:
        coded |= uncoded
    warm = [_rounded(x) == _POWER_ON for x, unit in forms if unit != "degC"]
    inside = codes & ~beyond & ~np.logical_or.reduce([np.zeros(len(values), dtype=bool), *warm])
    if inside.any() and not inside[finite & ~coded].all():
        good = finite & ~coded & ~inside
        span = min(declared.span, float(np.ptp(values[good])))
        coded |= inside & _far(values, good, _least_jump(values[good], span))
    return np.asarray(coded)


def _rounded(numbers: Array) -> Array:
    # What is too large to be rounded is none of the codes.
    with np.errstate(over="ignore"):
        return np.asarray(np.round(numbers, _DIGITS))


def _far(values: Array, good: Mask, least: float) -> Mask:
    """Which values are further from a straight line between the good ones around them."""
    index = np.arange(len(values))
    around = np.interp(index, index[good], values[good])
    return np.abs(values - around) > least


def _least_jump(good: Array, span: float) -> float:
    usual = float(np.quantile(np.abs(np.diff(good)), _USUAL)) if len(good) > 1 else 0.0
    return max(_JUMP * span, _JUMP_TIMES * usual)


def _jumps(values: Array, good: Mask, declared: Declared) -> Mask:
    """Samples of jumps that come back within two samples."""
    index = np.flatnonzero(good)
    out = np.zeros(len(values), dtype=bool)
    if len(index) > 5:
        y = values[index]
        windows = sliding_window_view(np.pad(y, 2, "edge"), 5)
        out[index] = np.abs(y - np.median(windows, axis=1)) > _least_jump(y, declared.span)
    return out


def _stuck(values: Array, good: Mask, steady: Mask, declared: Declared) -> list[tuple[Index, str]]:
    """Samples of each stretch in which a reading is stuck, and how that is known.

    It leaps there and back; or is noisy on both sides; or it moves on both, and jumps afterwards
    although no input steps. A reading at its lowest or highest may be clipped, one at 0 off, and
    one without noise at rest: these are not stuck.
    """
    index = np.flatnonzero(good)
    y = values[index]
    leap = _least_jump(y, declared.span) if len(np.unique(y)) > _LEVELS else np.inf
    out = []
    ends = _same(y)
    for (start, stop), leaps in zip(ends, _leaping(y, ends, leap), strict=True):
        n = stop - start
        if leaps and steady[index[[start, stop]]].all():
            out.append((index[start:stop], ", leaps there and back: no reading"))
            continue
        if n < STUCK_SAMPLES or y[start] in (0.0, y.min(), y.max()):
            continue
        before, after = y[max(0, start - 2 * n) : start], y[stop : stop + 2 * n]
        sides = [side for side in (before, after) if len(side) >= STUCK_SAMPLES]
        same = [(np.sum(np.diff(side) == 0.0) + 1.0) / (len(side) + 1.0) for side in sides]
        chance = max(same, default=1.0) ** (n - 1)
        if chance < STUCK_CHANCE and all(_noisy(side) for side in sides):
            out.append((index[start:stop], " and is noisy beside them: stuck"))
        elif len(sides) == 2 and chance < _LEAP_CHANCE and steady[index[stop]]:
            usual = max(np.abs(np.diff(side)).max() for side in sides)
            if abs(y[stop] - y[stop - 1]) > _LEAP * usual:
                out.append((index[start:stop], " and jumps afterwards: stuck"))
    return out


def _leaping(y: Array, ends: Sequence[tuple[int, int]], leap: float) -> list[bool]:
    """Which stretches leap to a value that the reading seldom has, and back to where it was."""
    out = [False] * len(ends)
    inside = [n for n, (start, stop) in enumerate(ends) if 0 < start < stop < len(y)]
    if not inside:
        return out
    start, stop = np.array([ends[n] for n in inside]).T
    there, back = np.abs(y[start] - y[start - 1]), np.abs(y[stop] - y[start])
    far = np.minimum(there, back) > np.maximum(leap, 2.0 * np.abs(y[stop] - y[start - 1]))
    for n in np.array(inside)[far]:
        out[n] = bool(np.mean(y == y[ends[n][0]]) <= _DROPPED)
    return out


def doubted_step(t_s: Array, longest_s: float) -> str:
    """What to ask where the samples of a time, shape (n,), are further apart than makes sense."""
    step_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    if step_s <= longest_s:
        return ""
    text = f"samples are {step_s:.6g} s apart, at most {longest_s:g} s make sense"
    unit = next((u for u in ("ms", "us", "ns") if step_s * UNITS[u].scale <= longest_s), "")
    ask = f": is the time in {unit}? name its column time_{unit}, or say `column_unit`"
    return text + (ask if unit else ": correct the time, or its unit")


def rows_each(values: Array, steady: Mask, changing: Mask) -> int:
    """In how many rows each reading of a column, shape (n,), stands; 1 where nothing shows that.

    A reading slower than its rows changes after so many, and by more than its resolution, as no
    slow course does. `steady` (n,): where no input steps; `changing` (n,): where one changes at
    all.
    """
    index = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[index])
    changes = np.flatnonzero(steps) + 1
    usable = steady[index[changes]]
    lengths = np.diff(changes)[usable[1:] & usable[:-1]]
    if len(lengths) < _CHANGES:
        return 1
    rows = int(np.argmax(np.bincount(lengths)))
    sizes = np.abs(steps[changes - 1][usable])
    off = np.abs(lengths - rows * np.maximum(np.rint(lengths / rows), 1.0))
    regular = np.mean(off <= (1.0 if rows > _SHORT else 0.0)) >= _REGULAR
    coarse = np.mean(sizes > 1.5 * sizes.min()) >= _STEPS
    driven = np.mean(changing[index[changes]]) - np.mean(changing) > _WITH_INPUT
    return rows if rows > 1 and regular and coarse and not driven else 1


def on_lines(column: Array, rows: int = 1) -> Array:
    """The column, shape (n,), on straight lines between its numbers, NaN before and after them.

    Where each of them stands in so many `rows`, between the first of each.
    """
    anchors = np.isfinite(column)
    if rows > 1:
        index = np.flatnonzero(anchors)
        since = np.zeros(len(index), dtype=np.intp)
        for start, stop in _same(column[index]):
            since[start:stop] = np.arange(stop - start)
        anchors[index] = since % rows == 0
    index = np.arange(len(column))
    return np.interp(index, index[anchors], column[anchors], left=np.nan, right=np.nan)


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
