"""The host's requests: one in flight, the rest waiting, a few tries each; a stop goes first.

An urgent request goes out at once, also while another is in flight. The board then drops repeats of
the older one, so it waits: its answer is still taken, and without one it is asked again, under a
new number, once the urgent one is done.

The time to wait for an answer follows the round trips seen (RFC 6298's estimate with a smaller
floor, as a serial line is short) and doubles with each try. An answer that came after a repeat is
not measured, because it cannot be known which of the two it answers (Karn's rule).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import msgspec

from firmware_protocol.errors import QueueFullError
from firmware_protocol.messages import FaultGet, FaultReport, Message, ParamSave
from firmware_protocol.stats import HostLinkStats

TRIES = 3
SAVE_TRIES = 6
"""Of PARAM_SAVE: a chip writes for 3.4 ms at each byte, for 0.9 s if every parameter changed."""
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
    urgent: bool = False
    seq: int = 0
    tries: int = 0
    sent_us: int = 0
    deadline_us: int = 0


def _answers(reply: Message, request: Message) -> bool:
    # One that the board sends unasked has its index as number, which may be that of a FAULT_GET.
    if isinstance(reply, FaultReport) and isinstance(request, FaultGet):
        return (reply.axis, reply.index) == (request.axis, request.index)
    return type(reply).__name__ in request.info.replies


class RequestQueue:
    """Requests in the order in which they were asked for, urgent ones before all others.

    `send(message, seq)` is called for each copy that is to go out; repeats are counted in `stats`.
    """

    def __init__(self, send: Callable[[Message, int], None], stats: HostLinkStats) -> None:
        self.round_trip = RoundTrip()
        self.timeouts_in_a_row = 0
        self._stats = stats
        self._send = send
        self._in_flight: Pending | None = None
        self._overtaken: Pending | None = None
        self._waiting: deque[Pending] = deque()
        self._last_id = 0
        self._last_seq = 0

    def add(
        self, message: Message, now_us: int, *, internal: bool = False, urgent: bool = False
    ) -> int:
        """Queue a request, or send it if none is in flight; return its id.

        An urgent one is sent now, whatever is in flight or waits, unless another urgent one is.
        Raises QueueFullError for one that is not urgent.
        """
        if len(self._waiting) >= QUEUE_LIMIT and not urgent:
            raise QueueFullError(
                f"{len(self._waiting)} requests are waiting, the limit is {QUEUE_LIMIT}; "
                "wait for answers before asking more"
            )
        self._last_id += 1
        pending = Pending(self._last_id, message, internal, urgent)
        if urgent:
            self._put_first(pending)
        else:
            self._waiting.append(pending)
        self._send_next(now_us)
        return self._last_id

    def withdraw(self, kinds: tuple[type[Message], ...], now_us: int) -> list[Pending]:
        """Take back requests of these kinds; return them. A copy on its way may still act."""
        taken = [pending for pending in self._all() if isinstance(pending.message, kinds)]
        self._waiting = deque(p for p in self._waiting if p not in taken)
        self._overtaken = None if self._overtaken in taken else self._overtaken
        self._in_flight = None if self._in_flight in taken else self._in_flight
        self._send_next(now_us)
        return taken

    def tick(self, now_us: int) -> Pending | None:
        """Repeat the request in flight if it is time; return it if its tries are used up."""
        pending = self._in_flight
        if pending is None or now_us < pending.deadline_us:
            return None
        if pending.tries < (SAVE_TRIES if isinstance(pending.message, ParamSave) else TRIES):
            self._stats.repeats += 1
            self._transmit(pending, now_us)
            return None
        self.timeouts_in_a_row += 1
        self._in_flight = None
        self._send_next(now_us)
        return pending

    def answered(self, reply: Message, seq: int, now_us: int) -> Pending | None:
        """Return the request that a reply with number `seq` answers, if any."""
        for pending in self._sent():
            if seq == pending.seq and _answers(reply, pending.message):
                return self._finish(pending, now_us)
        return None

    def refused(self, number: int, seq: int, now_us: int) -> Pending | None:
        """Return the request with message number `number` that an ERROR refuses, if any."""
        for pending in self._sent():
            if (pending.message.info.number, pending.seq) == (number, seq):
                return self._finish(pending, now_us)
        return None

    def drop_all(self) -> list[Pending]:
        """Give up everything, for a session that ended; return what was given up."""
        dropped = self._all()
        self._in_flight = None
        self._overtaken = None
        self._waiting.clear()
        self._last_seq = 0
        self.timeouts_in_a_row = 0
        return dropped

    @property
    def deadline_us(self) -> int | None:
        """When `tick` is needed next."""
        return None if self._in_flight is None else self._in_flight.deadline_us

    def _sent(self) -> list[Pending]:
        return [p for p in (self._in_flight, self._overtaken) if p is not None]

    def _all(self) -> list[Pending]:
        return [*self._sent(), *self._waiting]

    def _finish(self, pending: Pending, now_us: int) -> Pending:
        if pending.tries == 1:
            self.round_trip.sample(now_us - pending.sent_us)
        self.timeouts_in_a_row = 0
        if pending is self._overtaken:
            self._overtaken = None
        else:
            self._in_flight = None
        self._send_next(now_us)
        return pending

    def _put_first(self, urgent: Pending) -> None:
        ahead = sum(pending.urgent for pending in self._waiting)
        self._waiting.insert(ahead, urgent)
        if self._in_flight is not None and not self._in_flight.urgent:
            self._overtaken, self._in_flight = self._in_flight, None

    def _send_next(self, now_us: int) -> None:
        if self._in_flight is not None:
            return
        if self._overtaken is not None and not (self._waiting and self._waiting[0].urgent):
            # Its old number was overtaken, and the board would drop it.
            self._waiting.appendleft(self._overtaken)
            self._overtaken = None
        if self._waiting:
            self._in_flight = self._waiting.popleft()
            self._last_seq = (self._last_seq + 1) & 0xFF
            self._in_flight.seq = self._last_seq
            self._transmit(self._in_flight, now_us)

    def _transmit(self, pending: Pending, now_us: int) -> None:
        self._send(pending.message, pending.seq)
        pending.sent_us = now_us
        pending.deadline_us = now_us + (self.round_trip.rto_us << pending.tries)
        pending.tries += 1
