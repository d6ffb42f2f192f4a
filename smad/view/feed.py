"""From 500 samples a second to what a browser can draw: the extremes of short stretches of time.

Pure: the time of a sample is an argument. A `Tier` (`smad.view.tier`) cuts time into buckets of one
width and keeps the newest ones; the tiers of a `Feed` have the live windows and, held longer than
these, the past of the session.

A viewer remembers the last bucket it got and asks for those from there on (`Cursor`). One that was
slow gets everything up to now in a single frame, and never more than the window holds: nothing
waits in a queue, and nothing grows.
"""

import math

from msgspec import Struct

from smad.runlog.cycles import Cycles
from smad.view.tier import MOST_BUCKETS, Frame, Moments, Tier, Values

FRAMES_PER_S = 15.0
"""With 30 the browser took half as much again of the processor."""
BACKWARDS_S = 1.0
"""By so much the steered clock may step back; more is another clock, and begins anew."""
LONGEST_TAIL_S = 300.0
"""Of the points of an XY plot, which have the width of the finest bucket between them."""


class Window(Struct, frozen=True):
    """A length of time that a page can show, the width of a bucket in it, how many there are."""

    label: str
    bucket_s: float
    capacity: int = MOST_BUCKETS

    @property
    def span_s(self) -> float:
        """Seconds shown."""
        return self.bucket_s * MOST_BUCKETS


WINDOWS = (
    Window("30 s", 1 / 30, 9000),
    Window("5 min", 1 / 3, 10_800),
    Window("1 h", 4.0, 21_600),
    Window("24 h", 96.0),
)
"""Kept: 5 minutes, an hour and a day in fine buckets, and a day in coarse ones."""


class Feed:
    """What every page is fed from: one tier for each window. `epoch` counts new beginnings.

    `motion` is the channel whose turning points end a cycle.
    """

    def __init__(self, channels: int, motion: int = 0) -> None:
        self.tiers = tuple(Tier(w.bucket_s, channels, w.capacity) for w in WINDOWS)
        self.epoch = 0
        self._motion = motion
        self._cycles = Cycles()
        self.last_s = -math.inf

    @property
    def first_s(self) -> float | None:
        """Since when there is a past; None while nothing has come."""
        return min((t for tier in self.tiers if (t := tier.first_s) is not None), default=None)

    def add(self, time_s: float, values: Values) -> None:
        """Take in one sample at a Unix time; a clock that went back a lot clears the past."""
        if time_s < self.last_s - BACKWARDS_S:
            for tier in self.tiers:
                tier.clear()
            self.epoch += 1
            self.last_s = -math.inf
        self.last_s = max(self.last_s, time_s)
        cycle = self._cycles.add(values[self._motion])
        for tier in self.tiers:
            tier.add(time_s, values, cycle)

    def tier_for(self, from_s: float, to_s: float) -> Tier:
        """Return the tier that has a span with the fewest buckets that are fine enough for it.

        One that reaches back to its beginning, or else the one that reaches back furthest.
        """
        first_s = max(from_s, self.first_s or from_s)
        reaching = [
            tier
            for tier in self.tiers
            if tier.first_s is not None and tier.first_s <= first_s + tier.bucket_s
        ] or list(self.tiers[-1:])
        fine = [tier for tier in reaching if tier.bucket_s * MOST_BUCKETS <= to_s - from_s]
        return fine[-1] if fine else reaching[0]


class View(Struct, frozen=True, kw_only=True):
    """What a page shows: the number of a window, channels by their place, those of XY plots.

    The points of the XY plots are of the last `tail_s`.
    """

    window: int = 0
    channels: tuple[int, ...] = ()
    xy: tuple[int, ...] = ()
    tail_s: float = 60.0


class Cursor:
    """How far one page has been fed: what it shows, and the buckets it needs next."""

    def __init__(self, feed: Feed, view: View | None = None) -> None:
        self._feed = feed
        self._epoch = feed.epoch
        self.look_at(View() if view is None else view)

    def look_at(self, view: View) -> None:
        """Show something else: the next frame is a whole one."""
        self.view = view
        self._next: int | None = None
        self._next_moment: int | None = None

    def take(self) -> tuple[Frame, Moments | None, bool] | None:
        """Return what is new, and whether it replaces everything; None when there is nothing."""
        if self._epoch != self._feed.epoch:
            self._epoch = self._feed.epoch
            self.look_at(self.view)
        frames = self._feed.tiers[self.view.window].since(self._next, self.view.channels)
        if frames is None:
            return None
        whole = self._next is None
        frame, self._next = frames
        return frame, self._moments(), whole

    def _moments(self) -> Moments | None:
        if not self.view.xy:
            return None
        finest = self._feed.tiers[0]
        begin = self._next_moment
        if begin is None:
            begin = math.floor((self._feed.last_s - self.view.tail_s) / finest.bucket_s)
        moments, self._next_moment = finest.moments_since(begin, self.view.xy)
        return moments
