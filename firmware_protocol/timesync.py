"""Board time to host time: unwrapping the board's 32-bit clock, and a line through good exchanges.

One exchange has four stamps: t1 host sends, t2 board receives, t3 board sends, t4 host receives.
Its round trip is (t4 − t1) − (t3 − t2); the board's time (t2 + t3)/2 belongs to the host's time
(t1 + t4)/2, wrong by at most half the round trip. Delays only ever add, so the exchanges with the
shortest round trips are the truest: of each eight in a row the best one is kept, which spreads the
kept ones over the window, and the shorter its round trip, the more it weighs in the fit.

A clock can step: a board that was kept from running, or set. No line fits both sides of a step, so
when two exchanges in a row agree with each other and not with the line, whatever is older is
forgotten. What was merely late does not count: an exchange is only as exact as its round trip.

The rate is fitted only once the kept exchanges span `RATE_SPAN_US`; before, a microsecond of
noise would be read as a drift that no crystal has, so the clocks are taken to run alike.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import msgspec

from firmware_protocol.messages import TimeReply, TimeRequest

WINDOW = 128
GROUP = 8
LOCK_EXCHANGES = 8
FIRST_EXCHANGES = 16
FIRST_INTERVAL_US = 50_000
INTERVAL_US = 1_000_000
RATE_SPAN_US = 5_000_000
LARGEST_DRIFT = 1000e-6
LONGEST_GAP_US = 1_800_000_000
STEP_LEAST_US = 2_000
WRAP = 1 << 32


class Exchange(NamedTuple):
    """One exchange: middle times on both clocks and the round trip, in µs."""

    board_us: float
    host_us: float
    round_trip_us: int

    def agrees(self, other: Exchange) -> bool:
        """Whether one clock, as fast as a crystal may be, can have shown both."""
        apart_us = self.board_us - other.board_us
        trips_us = max(0, self.round_trip_us) + max(0, other.round_trip_us)
        moved_us = (self.host_us - other.host_us) - apart_us
        return abs(moved_us) <= trips_us / 2 + LARGEST_DRIFT * abs(apart_us)

    def outruns(self, earlier: Exchange) -> bool:
        """Whether the board's clock has gained more on the host's since than a crystal can.

        To lose is ordinary: a simulated board that is kept from running does.
        """
        gained_us = (self.board_us - earlier.board_us) - (self.host_us - earlier.host_us)
        return gained_us > 0.0 and not self.agrees(earlier)


class ClockFit(msgspec.Struct, frozen=True, gc=False):
    """host_us = host_ref_us + (board_us − board_ref_us)·(1 + drift).

    `drift` is host over board, less 1; 0 while the exchanges do not span enough to fit it.
    `steady`: the board's clock does not outrun the host's. `locked`: there are enough exchanges to
    arm on.
    """

    board_ref_us: float
    host_ref_us: float
    drift: float
    round_trip_us: int
    exchanges: int
    locked: bool
    steady: bool

    @property
    def plausible(self) -> bool:
        """Whether two crystals can run so; a simulation that is not real time does not."""
        return self.steady and abs(self.drift) <= LARGEST_DRIFT

    def host_us(self, board_us: float) -> float:
        """Return the host's time at a board time (64-bit)."""
        elapsed = board_us - self.board_ref_us
        return self.host_ref_us + elapsed + elapsed * self.drift

    def board_us(self, host_us: float) -> float:
        """Return the board's time (64-bit) at a host time."""
        return self.board_ref_us + (host_us - self.host_ref_us) / (1.0 + self.drift)


class Unwrapper:
    """Turns 32-bit microseconds into 64-bit ones.

    A stamp is taken to be near the latest one; after a gap in which the clock may have wrapped
    unseen, near where the caller's clock says that it should be.
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._last_now_us = 0

    def __call__(self, t_us: int, now_us: int) -> int:
        """Return the full time of a stamp, which may lie before the latest one."""
        if self._last is None:
            self._last, self._last_now_us = t_us, now_us
            return t_us
        gap_us = now_us - self._last_now_us
        near = self._last + (gap_us if gap_us > LONGEST_GAP_US else 0)
        full = near + ((t_us - near + WRAP // 2) % WRAP) - WRAP // 2
        if full > self._last:
            self._last, self._last_now_us = full, now_us
        return full


class TimeSync:
    """Collects exchanges and fits the line."""

    def __init__(self) -> None:
        self._window: deque[Exchange] = deque(maxlen=WINDOW)
        self.fit: ClockFit | None = None
        self.doubtful = False
        """Whether the latest exchange is off the line that was: another one will tell why."""

    def add(self, t1: int, t2: int, t3: int, t4: int) -> ClockFit:
        """Take in one exchange (all 64-bit µs) and return the new fit."""
        newest = Exchange((t2 + t3) / 2, (t1 + t4) / 2, (t4 - t1) - (t3 - t2))
        self.doubtful = self._off_the_line(newest)
        before = self._window[-1] if self._window else newest
        if self.doubtful and newest.agrees(before) and self._off_the_line(before):
            self._window.clear()
            self._window.append(before)
        self._window.append(newest)
        newest_first = list(self._window)[::-1]
        groups = [
            newest_first[start : start + GROUP]
            for start in range(0, max(1, len(newest_first) - GROUP + 1), GROUP)
        ]
        quickest = [min(group, key=lambda exchange: exchange.round_trip_us) for group in groups]
        self.fit = self._line(quickest)
        return self.fit

    def _off_the_line(self, exchange: Exchange) -> bool:
        fit = self.fit
        if fit is None:
            return False
        slack_us = STEP_LEAST_US + (max(0, exchange.round_trip_us) + fit.round_trip_us) / 2
        if fit.drift == 0.0:
            # The rate is not known yet.
            slack_us += LARGEST_DRIFT * abs(exchange.board_us - fit.board_ref_us)
        return abs(exchange.host_us - fit.host_us(exchange.board_us)) > slack_us

    def _line(self, exchanges: list[Exchange]) -> ClockFit:
        weights = [1.0 / (1.0 + max(0, exchange.round_trip_us)) ** 2 for exchange in exchanges]
        weighted = list(zip(weights, exchanges, strict=True))
        total = sum(weights)
        board_ref = sum(w * e.board_us for w, e in weighted) / total
        host_ref = sum(w * e.host_us for w, e in weighted) / total
        times = [exchange.board_us for exchange in exchanges]
        drift = 0.0
        if max(times) - min(times) >= RATE_SPAN_US:
            # The fit is of the difference of the clocks: its small numbers keep their digits.
            square = sum(w * (e.board_us - board_ref) ** 2 for w, e in weighted)
            product = sum(
                w * (e.board_us - board_ref) * ((e.host_us - host_ref) - (e.board_us - board_ref))
                for w, e in weighted
            )
            drift = product / square
        return ClockFit(
            board_ref_us=board_ref,
            host_ref_us=host_ref,
            drift=drift,
            round_trip_us=min(exchange.round_trip_us for exchange in exchanges),
            exchanges=len(self._window),
            locked=len(self._window) >= LOCK_EXCHANGES,
            # A fitted rate says it all. Until then a board that runs 40 times as fast as the host's
            # clock would pass for one that runs alike.
            steady=drift != 0.0 or not any(map(self._window[-1].outruns, self._window)),
        )


class TimeExchanges:
    """When to ask for the board's time, and what to make of the answers.

    Sixteen quick exchanges lock the clock after a connection; then one a second holds it.
    """

    def __init__(self) -> None:
        self.sync = TimeSync()
        self.unwrap = Unwrapper()
        self.due_us = 0
        self._asked_us: int | None = None
        self._count = 0

    def begin(self, now_us: int) -> None:
        """Ask quickly from now on, as after a reconnection to a board that kept running."""
        self.due_us = now_us
        self._asked_us = None
        self._count = 0

    def ask(self, now_us: int) -> TimeRequest:
        """Return the request to send now."""
        self._asked_us = now_us
        self._count += 1
        quick = self._count < FIRST_EXCHANGES
        self.due_us = now_us + (FIRST_INTERVAL_US if quick else INTERVAL_US)
        return TimeRequest(t1_us=now_us % WRAP)

    def answer(self, reply: TimeReply, now_us: int) -> ClockFit | None:
        """Take in an answer; None if it answers no request of ours, or is a second copy."""
        asked_us = self._asked_us
        if asked_us is None or reply.t1_us != asked_us % WRAP:
            return None
        self._asked_us = None
        t2, t3 = self.unwrap(reply.t2_us, now_us), self.unwrap(reply.t3_us, now_us)
        before = self.sync.fit
        fit = self.sync.add(asked_us, t2, t3, now_us)
        if before is not None and fit.exchanges < before.exchanges:
            self.begin(now_us)
        elif before is not None and before.plausible and self.sync.doubtful:
            self.due_us = now_us + FIRST_INTERVAL_US
        return fit

    def host_us(self, t_us: int, now_us: int) -> float | None:
        """Return the host's time of a recent stamp of the board's; None while it is not known.

        It is not before the first exchange, nor for a simulation that is not real time.
        """
        fit = self.sync.fit
        if fit is None or not fit.plausible:
            return None
        return fit.host_us(self.unwrap(t_us, now_us))
