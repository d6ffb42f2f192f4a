"""The host's requests: one in flight, the rest waiting, three tries each.

The time to wait for an answer follows the round trips seen (RFC 6298's estimate with a smaller
floor, as a serial line is short) and doubles with each try. An answer that came after a repeat is
not measured, because it cannot be known which of the two it answers (Karn's rule).
"""

from __future__ import annotations

from collections import deque

import msgspec

from firmware_protocol.errors import QueueFullError
from firmware_protocol.messages import Message

TRIES = 3
LEAST_RTO_US = 25_000
FIRST_RTO_US = 100_000
MOST_RTO_US = 500_000
QUEUE_LIMIT = 512


class RoundTrip:
    """Smoothed round trip and its spread, in µs."""

    def __init__(self) -> None:
        self.srtt_us: float | None = None
        self.rttvar_us = 0.0

    def sample(self, round_trip_us: int) -> None:
        """Take in one measured round trip."""
        if self.srtt_us is None:
            self.srtt_us = float(round_trip_us)
            self.rttvar_us = round_trip_us / 2
        else:
            self.rttvar_us += (abs(self.srtt_us - round_trip_us) - self.rttvar_us) / 4
            self.srtt_us += (round_trip_us - self.srtt_us) / 8

    @property
    def rto_us(self) -> int:
        """How long to wait for an answer before asking again."""
        if self.srtt_us is None:
            return FIRST_RTO_US
        return min(MOST_RTO_US, max(LEAST_RTO_US, int(self.srtt_us + 4 * self.rttvar_us)))


class Pending(msgspec.Struct):
    """A request on its way. `internal` ones belong to the session, not to its user."""

    id: int
    message: Message
    internal: bool
    seq: int = 0
    tries: int = 0
    sent_us: int = 0
    deadline_us: int = 0


class RequestQueue:
    """Requests in the order in which they were asked for."""

    def __init__(self) -> None:
        self.round_trip = RoundTrip()
        self.in_flight: Pending | None = None
        self._waiting: deque[Pending] = deque()
        self._last_id = 0
        self._last_seq = 0

    def add(self, message: Message, *, internal: bool = False) -> int:
        """Queue a request and return its id. Raises QueueFullError."""
        if len(self._waiting) >= QUEUE_LIMIT:
            raise QueueFullError(
                f"{len(self._waiting)} requests are waiting, the limit is {QUEUE_LIMIT}; "
                "wait for answers before asking more"
            )
        self._last_id += 1
        self._waiting.append(Pending(self._last_id, message, internal))
        return self._last_id

    def start_next(self) -> Pending | None:
        """Return the next request to send if none is in flight."""
        if self.in_flight is not None or not self._waiting:
            return None
        self.in_flight = self._waiting.popleft()
        self._last_seq = (self._last_seq + 1) & 0xFF
        self.in_flight.seq = self._last_seq
        return self.in_flight

    def sent(self, now_us: int) -> None:
        """Note that the request in flight was sent once more."""
        pending = self.in_flight
        if pending is not None:
            pending.sent_us = now_us
            pending.deadline_us = now_us + (self.round_trip.rto_us << pending.tries)
            pending.tries += 1

    def finish(self, now_us: int) -> None:
        """Note that the request in flight was answered."""
        pending = self.in_flight
        if pending is not None and pending.tries == 1:
            self.round_trip.sample(now_us - pending.sent_us)
        self.in_flight = None

    def drop(self) -> None:
        """Give up the request in flight."""
        self.in_flight = None

    def drop_all(self) -> list[Pending]:
        """Give up everything, for a session that ended; return what was given up."""
        dropped = [*([self.in_flight] if self.in_flight else []), *self._waiting]
        self.in_flight = None
        self._waiting.clear()
        self._last_seq = 0
        return dropped
