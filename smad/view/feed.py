"""From 500 samples a second to what a browser can draw: the extremes of short stretches of time.

Pure: the time of a sample is an argument. A `Tier` cuts time into buckets of one width and keeps
the newest ones; of each channel a bucket keeps the smallest and the largest value, in the order in
which they came, so that a spike of one sample is drawn at any width.

A viewer remembers the last bucket it got and asks for those from there on (`Tier.since`). One that
was slow gets everything up to now in a single frame, and never more than the tier holds: nothing
waits in a queue, and nothing grows.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from itertools import dropwhile

from msgspec import Struct

FRAMES_PER_S = 30.0
MOST_BUCKETS = 900
GAP_S = 1.5
"""Seconds without a sample after which the line is broken, not drawn through."""
BACKWARDS_S = 1.0
"""By so much the steered clock may step back; more is another clock, and begins anew."""
_DIGITS = 4

Values = Sequence[float | None]
Curve = list[float | None]


class Window(Struct, frozen=True):
    """A length of time that a page can show, and the width of a bucket in it."""

    label: str
    bucket_s: float

    @property
    def span_s(self) -> float:
        """Seconds shown."""
        return self.bucket_s * MOST_BUCKETS


WINDOWS = (Window("30 s", 1 / 30), Window("5 min", 1 / 3), Window("1 h", 4.0))


class Frame(Struct, frozen=True):
    """Points that replace all from `from_s` on. `y` has one list a channel, as long as `t`."""

    from_s: float
    t: list[float]
    y: list[Curve]


class Bucket:
    """The extremes of a stretch of time, channel by channel."""

    __slots__ = ("after_gap", "high", "low", "number", "rising")

    def __init__(self, number: int, channels: int, *, after_gap: bool) -> None:
        self.number = number
        self.after_gap = after_gap
        self.low: Curve = [None] * channels
        self.high: Curve = [None] * channels
        self.rising = [True] * channels

    def add(self, values: Values) -> None:
        """Take in one sample."""
        for channel, value in enumerate(values):
            if value is None or not math.isfinite(value):
                continue
            low, high = self.low[channel], self.high[channel]
            if low is None or high is None:
                self.low[channel] = self.high[channel] = value
            elif value < low:
                self.low[channel] = value
                self.rising[channel] = False
            elif value > high:
                self.high[channel] = value
                self.rising[channel] = True


class Tier:
    """The newest buckets of one width."""

    def __init__(self, bucket_s: float, channels: int, most: int = MOST_BUCKETS) -> None:
        self.bucket_s = bucket_s
        self._channels = channels
        self._buckets: deque[Bucket] = deque(maxlen=most)
        self._last_s = -math.inf

    def __len__(self) -> int:
        return len(self._buckets)

    def clear(self) -> None:
        """Forget everything."""
        self._buckets.clear()
        self._last_s = -math.inf

    def add(self, time_s: float, values: Values) -> None:
        """Take in one sample; a time before that of the newest bucket counts into that one."""
        number = math.floor(time_s / self.bucket_s)
        newest = self._buckets[-1] if self._buckets else None
        if newest is None or number > newest.number:
            gap = newest is not None and time_s - self._last_s > GAP_S
            newest = Bucket(number, self._channels, after_gap=gap)
            self._buckets.append(newest)
        newest.add(values)
        self._last_s = max(self._last_s, time_s)

    def since(self, number: int | None) -> tuple[Frame, int] | None:
        """Return the buckets from `number` on (None: all) and the number to ask for next.

        The newest bucket is still filling, so it is the first of the next frame again.
        """
        if not self._buckets:
            return None
        begin = self._buckets[0].number if number is None else number
        buckets = list(dropwhile(lambda bucket: bucket.number < begin, self._buckets))
        if not buckets:
            return None
        return self._frame(buckets), buckets[-1].number

    def _frame(self, buckets: Iterable[Bucket]) -> Frame:
        times: list[float] = []
        curves: list[Curve] = [[] for _ in range(self._channels)]
        for bucket in buckets:
            begin_s = bucket.number * self.bucket_s
            if bucket.after_gap:
                times.append(_rounded_time(begin_s - self.bucket_s / 4))
                for curve in curves:
                    curve.append(None)
            times += (_rounded_time(begin_s), _rounded_time(begin_s + self.bucket_s / 2))
            for channel, curve in enumerate(curves):
                low, high = _rounded(bucket.low[channel]), _rounded(bucket.high[channel])
                curve.extend((low, high) if bucket.rising[channel] else (high, low))
        first = times[0] - self.bucket_s / 4
        return Frame(from_s=_rounded_time(first), t=times, y=curves)


class Feed:
    """What every page is fed from: one tier for each window. `epoch` counts new beginnings."""

    def __init__(self, channels: int, windows: Sequence[Window] = WINDOWS) -> None:
        self.tiers = tuple(Tier(window.bucket_s, channels) for window in windows)
        self.epoch = 0
        self._last_s = -math.inf

    def add(self, time_s: float, values: Values) -> None:
        """Take in one sample at a Unix time; a clock that went back a lot clears the past."""
        if time_s < self._last_s - BACKWARDS_S:
            for tier in self.tiers:
                tier.clear()
            self.epoch += 1
            self._last_s = -math.inf
        self._last_s = max(self._last_s, time_s)
        for tier in self.tiers:
            tier.add(time_s, values)


class Cursor:
    """How far one page has been fed: its window and the bucket it needs next."""

    def __init__(self, feed: Feed, window: int = 0) -> None:
        self._feed = feed
        self.window = window
        self._epoch = feed.epoch
        self._next: int | None = None

    def look_at(self, window: int) -> None:
        """Change the window: the next frame is a whole one."""
        self.window = window
        self._next = None

    def take(self) -> tuple[Frame, bool] | None:
        """Return what is new, and whether it replaces everything; None when there is nothing."""
        if self._epoch != self._feed.epoch:
            self._epoch = self._feed.epoch
            self._next = None
        found = self._feed.tiers[self.window].since(self._next)
        if found is None:
            return None
        whole = self._next is None
        frame, self._next = found
        return frame, whole


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, _DIGITS)


def _rounded_time(time_s: float) -> float:
    return round(time_s, 5)
