"""Buckets of one width, the newest of them, in memory that does not grow.

Of each channel a bucket keeps the smallest and the largest value, in the order in which they came,
so that a spike of one sample is drawn at any width; and its last sample, whose channels belong to
one moment: those are the points of an XY plot.
"""

import math
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Sequence

from msgspec import Struct

MOST_BUCKETS = 900
MOST_MOMENTS = 3000
GAP_S = 1.5
"""Seconds without a sample after which the line is broken, not drawn through."""
_DIGITS = 4

Values = Sequence[float | None]
Curve = list[float | None]


class Frame(Struct, frozen=True):
    """Points that replace all from `from_s` on. `y` has one list a channel, as long as `t`."""

    from_s: float
    t: list[float]
    y: list[Curve]


class Moments(Struct, frozen=True):
    """Samples of one moment each: `t`, the number of the `cycle`, `y` one list a channel."""

    from_s: float
    t: list[float]
    cycle: list[int]
    y: list[Curve]


class Tier:
    """The newest `capacity` buckets, the last of them still filling."""

    def __init__(self, bucket_s: float, channels: int, capacity: int = MOST_BUCKETS) -> None:
        self.bucket_s = bucket_s
        self._channels = channels
        self._capacity = capacity
        # Closed buckets stand in rings, by count modulo `capacity`; NaN: nothing was measured.
        self._number = array("q", bytes(8 * capacity))
        self._after_gap = bytearray(capacity)
        self._cycle = array("l", bytes(array("l").itemsize * capacity))
        self._last_s = array("d", bytes(8 * capacity))
        self._low, self._high, self._last = (
            array("f", bytes(4 * capacity * channels)) for _ in range(3)
        )
        self._rising = bytearray(capacity * channels)
        self.clear()

    def __len__(self) -> int:
        return min(self._count, self._capacity)

    @property
    def first_s(self) -> float | None:
        """When the oldest bucket begins; None while there is none."""
        if not self._count:
            return None
        return self._number[(self._count - len(self)) % self._capacity] * self.bucket_s

    def clear(self) -> None:
        """Forget everything."""
        self._count = 0
        self._newest_s = -math.inf
        self._open = _Bucket(0, self._channels)

    def add(self, time_s: float, values: Values, cycle: int = 0) -> None:
        """Take in one sample; a time before that of the newest bucket counts into that one."""
        number = math.floor(time_s / self.bucket_s)
        if not self._count or number > self._open.number:
            self._store()
            self._open = _Bucket(number, self._channels)
            slot = self._count % self._capacity
            self._after_gap[slot] = self._count > 0 and time_s - self._newest_s > GAP_S
            self._number[slot] = number
            self._count += 1
        self._newest_s = max(self._newest_s, time_s)
        slot = (self._count - 1) % self._capacity
        self._last_s[slot], self._cycle[slot] = time_s, cycle
        self._open.add(values)

    def since(self, number: int | None, channels: Sequence[int]) -> tuple[Frame, int] | None:
        """Return the buckets from `number` on (None: the newest 900) and the number to ask next.

        The newest bucket is still filling, so it is the first of the next frame again.
        """
        if not self._count:
            return None
        begin = max(self._count - MOST_BUCKETS, self._count_from(number))
        if begin == self._count:
            return None
        self._store()
        t, breaks = self._times(begin, self._count, 1)
        y = [self._curve(begin, self._count, 1, channel, breaks) for channel in channels]
        # Between the first point, which may be a break, and the last of the bucket before.
        return Frame(rounded_time(t[0] - self.bucket_s / 8), t, y), self._open.number

    def between(self, from_s: float, to_s: float, channels: Sequence[int]) -> Iterator[Curve]:
        """Yield the times between two times, then the values of each channel at these.

        Neighbours are put together until they are at most 900 stretches.
        """
        begin, end, fold = self._span(from_s, to_s, MOST_BUCKETS)
        t, breaks = self._times(begin, end, fold)
        yield [*t]
        for channel in channels:
            yield self._curve(begin, end, fold, channel, breaks)

    def moments_since(self, number: int, channels: Sequence[int]) -> tuple[Moments, int]:
        """Return the last sample of each bucket from `number` on, and the number to ask next."""
        return self._moments(self._count_from(number), self._count, 1, channels), self._open.number

    def moments_between(self, from_s: float, to_s: float, channels: Sequence[int]) -> Moments:
        """Return the last samples of buckets between two times, 3000 at most."""
        return self._moments(*self._span(from_s, to_s, MOST_MOMENTS), channels)

    def _count_from(self, number: int | None) -> int:
        """The count of the first bucket from a number on."""
        numbers = range(self._count - len(self), self._count)
        if number is None:
            return numbers.start
        return numbers.start + bisect_left(
            numbers, number, key=lambda k: self._number[k % self._capacity]
        )

    def _span(self, from_s: float, to_s: float, most: int) -> tuple[int, int, int]:
        """First and last count of what lies between, with neighbours, and how many to fold."""
        self._store()
        begin = self._count_from(math.floor(from_s / self.bucket_s))
        end = self._count_from(math.floor(to_s / self.bucket_s) + 1)
        begin, end = max(self._count - len(self), begin - 1), min(self._count, end + 1)
        return begin, end, max(1, -(-(end - begin) // most))

    def _moments(self, begin: int, end: int, fold: int, channels: Sequence[int]) -> Moments:
        self._store()
        slots = [k % self._capacity for k in range(begin, end, fold)]
        wide = self._channels
        t = [rounded_time(self._last_s[slot]) for slot in slots]
        y = [[rounded(self._last[slot * wide + channel]) for slot in slots] for channel in channels]
        from_s = self._number[slots[0]] * self.bucket_s if slots else 0.0
        return Moments(rounded_time(from_s), t, [self._cycle[slot] for slot in slots], y)

    def _times(self, begin: int, end: int, fold: int) -> tuple[list[float], frozenset[int]]:
        """Two times a stretch and one a break, and the counts at which there is a break."""
        times: list[float] = []
        breaks = set()
        for k in range(begin, end, fold):
            begin_s = self._number[k % self._capacity] * self.bucket_s
            if any(self._after_gap[j % self._capacity] for j in range(k, min(k + fold, end))):
                breaks.add(k)
                times.append(rounded_time(begin_s - self.bucket_s / 4))
            times += (rounded_time(begin_s), rounded_time(begin_s + fold * self.bucket_s / 2))
        return times, frozenset(breaks)

    def _curve(
        self, begin: int, end: int, fold: int, channel: int, breaks: frozenset[int]
    ) -> Curve:
        curve: Curve = []
        wide, most = self._channels, self._capacity
        for k in range(begin, end, fold):
            if k in breaks:
                curve.append(None)
            places = [(j % most) * wide + channel for j in range(k, min(k + fold, end))]
            lows = [v for p in places if (v := self._low[p]) == v]
            low = min(lows, default=math.nan)
            high = max((v for p in places if (v := self._high[p]) == v), default=math.nan)
            rising = self._rising[places[0]] if fold == 1 else not lows or lows[0] <= lows[-1]
            curve.extend((rounded(low), rounded(high)) if rising else (rounded(high), rounded(low)))
        return curve

    def _store(self) -> None:
        """Put the bucket that is filling into its place in the rings."""
        if not self._count:
            return
        begin = ((self._count - 1) % self._capacity) * self._channels
        place = slice(begin, begin + self._channels)
        self._low[place] = array("f", self._open.low)
        self._high[place] = array("f", self._open.high)
        self._last[place] = array("f", self._open.last)
        self._rising[place] = self._open.rising


class _Bucket:
    """The extremes of a stretch of time, channel by channel, and its last sample."""

    __slots__ = ("high", "last", "low", "number", "rising")

    def __init__(self, number: int, channels: int) -> None:
        self.number = number
        self.low = [math.nan] * channels
        self.high = [math.nan] * channels
        self.last = [math.nan] * channels
        self.rising = bytearray(b"\1" * channels)

    def add(self, values: Values) -> None:
        low, high, last = self.low, self.high, self.last
        for channel, value in enumerate(values):
            # Missing, NaN and infinite are no measurements.
            if value is None or not -_LARGEST < value < _LARGEST:
                last[channel] = math.nan
                continue
            last[channel] = value
            if not low[channel] <= value:
                # The first value is both; a later one below all is the low that came last.
                self.rising[channel] = low[channel] != low[channel]
                low[channel] = value
                if self.rising[channel]:
                    high[channel] = value
            elif value > high[channel]:
                high[channel] = value
                self.rising[channel] = True


_LARGEST = 3e38
"""Beyond it a number of four bytes is infinite."""


def rounded(value: float) -> float | None:
    """Return a value as it is sent; None for NaN."""
    return None if math.isnan(value) else round(value, _DIGITS)


def rounded_time(time_s: float) -> float:
    """Return a time as it is sent."""
    return round(time_s, 5)
