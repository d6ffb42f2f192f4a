"""The host's end of a session.

Theory of operation. `connect` sends HELLO until IDENT echoes its nonce; from then on frames carry
the session number that IDENT gave. STATE frames come by themselves. A setpoint waits in one slot,
so that only the latest is ever sent. Requests go one at a time and are repeated; the board
answers a repeat from its memory, so they act at most once.

Three rules:

1. A new connection always lands in MONITOR. RUNNING is reached only through ARM_REQUEST and
   ARM_CONFIRM made in this session, never because the board happens to be armed.
2. Anything that says that the board is not in this session (its boot message, three frames of
   another session in a row, silence) ends the session; then it begins again with HELLO.
3. Bytes received never raise. What is wrong with them is counted in `stats`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.description import Download, ForeignCodec
from firmware_protocol.enums import BoardState, ValidBit
from firmware_protocol.errors import (
    NotAllowedError,
    NotARequestError,
    NotConnectedError,
    PayloadError,
    SchemaError,
)
from firmware_protocol.events import (
    BoardRestarted,
    Connected,
    ErrorReceived,
    FailureReason,
    FaultReported,
    HostEvent,
    HostState,
    Incompatible,
    IncompatibleReason,
    LinkLost,
    RequestDone,
    RequestFailed,
    StateReceived,
    StatsReceived,
    TimeSynced,
)
from firmware_protocol.framing import DELIMITER, DecoderStats, Frame, FrameDecoder, encode_frame
from firmware_protocol.mirror import Mirror
from firmware_protocol.requests import TRIES, Pending, RequestQueue
from firmware_protocol.schema import describe, differences, schema_crc
from firmware_protocol.setpoints import SetpointSlot
from firmware_protocol.timesync import ClockFit, TimeExchanges

HELLO_US = (100_000, 200_000, 400_000, 1_000_000)
"""Time from one HELLO to the next; the last one repeats."""

SILENCE_US = 500_000
PAUSE_US = 100_000
FOREIGN_LIMIT = 3
TIMEOUT_LIMIT = 3
ESTOP_COPIES = 3
FIRST_BOARD_NUMBER = 0x80


class HostLinkStats(msgspec.Struct):
    """What the session has counted since it was made; `decoder` counts damaged frames."""

    decoder: DecoderStats
    states: int = 0
    missed_states: int = 0
    old_states: int = 0
    session_errors: int = 0
    payload_errors: int = 0
    unknown_types: int = 0
    echoes: int = 0
    ack_errors: int = 0
    repeats: int = 0
    timeouts: int = 0
    unmatched_replies: int = 0
    setpoints_sent: int = 0
    setpoints_dropped: int = 0


class HostSession:
    """One board on one port: bytes and time in, bytes and events out.

    `nonce` should differ from run to run (a random number): it tells the board's answers to this
    host from those to an earlier one. `now_us` is any monotonic clock.
    """

    def __init__(self, *, nonce: int, codec: Codec = CODEC) -> None:
        self.board: m.Ident | None = None
        self.incompatible: Incompatible | None = None
        self.session = 0
        self._codec = codec
        self._description = describe(codec)
        self._schema_crc = schema_crc(self._description)
        self._decoder = FrameDecoder()
        self.stats = HostLinkStats(self._decoder.stats)
        self._nonce = nonce & 0xFFFFFFFF
        self._open = False
        self._mirror: Mirror | None = None
        self._hellos = 0
        self._hello_due_us: int | None = None
        self._out = bytearray()
        self._urgent = bytearray()
        self._now_us = 0
        self._last_sent_us: int | None = None
        self._estop_wanted = False
        self._handlers: dict[type[m.Message], Callable[[Any, Frame, list[HostEvent]], None]] = {
            m.State: self._on_state,
            m.Ident: self._on_ident,
            m.Error: self._on_error,
            m.FaultReport: self._on_fault,
            m.TimeReply: self._on_time,
            m.LinkStats: self._on_stats,
            m.Description: self._on_reply,
            m.ArmToken: self._on_reply,
            m.Done: self._on_reply,
            m.ParamValue: self._on_reply,
        }
        self._begin_session(0)

    @property
    def state(self) -> HostState:
        """Where the host stands with its board."""
        if not self._open:
            return HostState.DISCONNECTED
        return HostState.SYNC if self._mirror is None else self._mirror.state

    @property
    def clock(self) -> ClockFit | None:
        """Board time to host time, None before the first exchange."""
        return self._time.sync.fit

    def connect(self, now_us: int) -> list[HostEvent]:
        """Begin on a port just opened: HELLO, repeated until the board answers.

        Returns the failures of the requests that waited in a session not closed with `lost`.
        """
        events = self.lost(now_us)
        self._open = True
        self._decoder.reset()
        self._last_sent_us = None
        self._synchronise(now_us)
        return events

    def lost(self, now_us: int) -> list[HostEvent]:
        """The port went away. Returns the failures of the requests that were waiting."""
        self._now_us = now_us
        events: list[HostEvent] = []
        self._end_session(FailureReason.LINK_LOST, events)
        self._open = False
        self._hello_due_us = None
        self._out.clear()
        self._urgent.clear()
        return events

    def receive(self, data: bytes, now_us: int) -> list[HostEvent]:
        """Take in bytes from the port; return what they mean. Never raises."""
        self._now_us = now_us
        events: list[HostEvent] = []
        if self._open:
            for frame in self._decoder.feed(data):
                self._on_frame(frame, events)
            self._run_timers(now_us, events)
        return events

    def tick(self, now_us: int) -> list[HostEvent]:
        """Repeat what was not answered and give up what never will be."""
        self._now_us = now_us
        events: list[HostEvent] = []
        if self._open:
            self._run_timers(now_us, events)
        return events

    def next_deadline_us(self) -> int | None:
        """Return when `tick` is needed next, None while nothing is awaited."""
        deadlines = [self._hello_due_us]
        if self._mirror is not None:
            deadlines += [self._heard_us + SILENCE_US, self._mirror.deadline_us]
            if self.incompatible is None:
                deadlines.append(self._time.due_us)
            if self._requests.in_flight is not None:
                deadlines.append(self._requests.in_flight.deadline_us)
        return min((deadline for deadline in deadlines if deadline is not None), default=None)

    def request(self, message: m.Message, now_us: int) -> int:
        """Ask the board for something; return the id that its RequestDone or -Failed will carry.

        Raises NotARequestError, NotConnectedError, NotAllowedError (another schema),
        QueueFullError, and PayloadError for a message that does not fit the wire.
        """
        self._now_us = now_us
        name = type(message).__name__
        if not message.info.replies or isinstance(message, m.Hello):
            raise NotARequestError(f"{name} is no request; nothing answers it")
        if self._mirror is None:
            raise NotConnectedError(f"{name} cannot be sent in {self.state.name}; connect first")
        if self.incompatible is not None and not isinstance(message, m.Describe):
            raise NotAllowedError(
                f"{name} cannot be sent to a board with another table of messages; it may only be "
                "watched. Update the older of the two"
            )
        self._codec.pack(message)
        id_ = self._requests.add(message)
        self._send_next_request(now_us)
        return id_

    def send_setpoint(self, setpoint: m.Setpoint) -> None:
        """Put a setpoint in the slot; only the latest of each axis is sent.

        Without a session, or with a board of another schema, it is dropped and counted. Raises
        PayloadError if it does not fit the wire.
        """
        payload = self._codec.pack(setpoint)
        shut = self._mirror is None or self.incompatible is not None
        if shut or self._setpoints.offer(setpoint.axis, payload):
            self.stats.setpoints_dropped += 1

    def send_estop(self) -> None:
        """Stop everything: three copies at once, and again until the board says ESTOP."""
        if not self._open:
            raise NotConnectedError("ESTOP cannot be sent without a port; cut the power")
        self._estop_wanted = True
        frame = self._codec.frame(m.Estop(), 0, self.session)
        self._urgent += DELIMITER + frame * ESTOP_COPIES

    def data_to_send(self) -> bytes:
        """Return all bytes to write now; a second call returns none."""
        for seq, payload in self._setpoints.take():
            self._out += encode_frame(m.Setpoint.info.number, seq, self.session, payload)
            self.stats.setpoints_sent += 1
        if not self._out and not self._urgent:
            return b""
        paused = self._last_sent_us is None or self._now_us - self._last_sent_us > PAUSE_US
        data = (DELIMITER if paused else b"") + bytes(self._urgent) + bytes(self._out)
        self._urgent.clear()
        self._out.clear()
        self._last_sent_us = self._now_us
        return data

    # Beginnings and endings

    def _begin_session(self, number: int) -> None:
        self.session = number
        self._requests = RequestQueue()
        self._setpoints = SetpointSlot()
        self._time = TimeExchanges(self._now_us)
        self._download: Download | None = None
        self._foreign: ForeignCodec | None = None
        self._reported: set[tuple[int, int]] = set()
        self._state_seq: int | None = None
        self._strangers = 0
        self._timeouts_in_a_row = 0
        self._heard_us = self._now_us
        self.incompatible = None

    def _end_session(self, reason: FailureReason, events: list[HostEvent]) -> None:
        for pending in self._requests.drop_all():
            self._fail(pending, reason, events)
        self._begin_session(0)
        self._mirror = None

    def _synchronise(self, now_us: int) -> None:
        self._begin_session(0)
        self._mirror = None
        self._nonce = (self._nonce + 1) & 0xFFFFFFFF
        self._hellos = 0
        self._send_hello(now_us)

    def _restart(self, event: HostEvent, reason: FailureReason, events: list[HostEvent]) -> None:
        self._end_session(reason, events)
        events.append(event)
        self._synchronise(self._now_us)

    def _send_hello(self, now_us: int) -> None:
        hello = m.Hello(
            major=m.PROTOCOL_MAJOR,
            minor=m.PROTOCOL_MINOR,
            schema_crc=self._schema_crc,
            nonce=self._nonce,
        )
        self._out += DELIMITER + self._codec.frame(hello, self._hellos & 0xFF, 0)
        self._hello_due_us = now_us + HELLO_US[min(self._hellos, len(HELLO_US) - 1)]
        self._hellos += 1

    # Timers

    def _run_timers(self, now_us: int, events: list[HostEvent]) -> None:
        if self._hello_due_us is not None:
            if now_us >= self._hello_due_us:
                self._send_hello(now_us)
            return
        if self._mirror is None:
            return
        self._mirror.tick(now_us)
        if now_us - self._heard_us >= SILENCE_US:
            silent_us = now_us - self._heard_us
            self._restart(LinkLost(silent_us), FailureReason.LINK_LOST, events)
            return
        pending = self._requests.in_flight
        if pending is not None and now_us >= pending.deadline_us:
            self._repeat_or_fail(pending, now_us, events)
        if self._mirror is not None and self.incompatible is None and now_us >= self._time.due_us:
            question = self._time.ask(now_us)
            if question is not None:
                self._out += self._codec.frame(question, 0, self.session)

    def _repeat_or_fail(self, pending: Pending, now_us: int, events: list[HostEvent]) -> None:
        if pending.tries < TRIES:
            self.stats.repeats += 1
            self._transmit(pending, now_us)
            return
        self.stats.timeouts += 1
        self._timeouts_in_a_row += 1
        self._requests.drop()
        self._fail(pending, FailureReason.TIMEOUT, events)
        if self._timeouts_in_a_row >= TIMEOUT_LIMIT:
            # Its sequence numbers and ours have drifted too far apart to be trusted.
            self._restart(LinkLost(now_us - self._heard_us), FailureReason.LINK_LOST, events)
        elif pending.internal:
            self._download_next()
        self._send_next_request(now_us)

    # Requests

    def _send_next_request(self, now_us: int) -> None:
        pending = self._requests.start_next()
        if pending is not None:
            self._transmit(pending, now_us)

    def _transmit(self, pending: Pending, now_us: int) -> None:
        self._out += self._codec.frame(pending.message, pending.seq, self.session)
        self._requests.sent(now_us)

    def _fail(
        self,
        pending: Pending,
        reason: FailureReason,
        events: list[HostEvent],
        error: m.Error | None = None,
    ) -> None:
        if isinstance(pending.message, m.ArmConfirm) and self._mirror is not None:
            self._mirror.refused()
        if not pending.internal:
            events.append(RequestFailed(pending.id, pending.message, reason, error))

    # Frames

    def _on_frame(self, frame: Frame, events: list[HostEvent]) -> None:
        if frame.type < FIRST_BOARD_NUMBER:
            self.stats.echoes += 1
            return
        codec: Codec | ForeignCodec = self._foreign or self._codec
        if not codec.knows(frame.type):
            self.stats.unknown_types += 1
            return
        try:
            message = codec.unpack(frame.type, frame.payload)
        except PayloadError:
            self.stats.payload_errors += 1
            return
        kind = type(message)
        if kind is not m.Ident:
            if self._mirror is None:
                return
            if frame.session != self.session:
                self._on_stranger(events)
                return
            if not kind.info.frozen and self.incompatible is not None and self._foreign is None:
                return
            self._strangers = 0
            self._heard_us = self._now_us
        self._handlers[kind](message, frame, events)

    def _on_stranger(self, events: list[HostEvent]) -> None:
        self.stats.session_errors += 1
        self._strangers += 1
        if self._strangers >= FOREIGN_LIMIT:
            self._restart(BoardRestarted(None), FailureReason.BOARD_RESTARTED, events)

    def _on_ident(self, ident: m.Ident, frame: Frame, events: list[HostEvent]) -> None:
        if self._mirror is not None:
            reborn = ident.session == 0 and self.board is not None
            if reborn and self.board and ident.boot_count != self.board.boot_count:
                self._restart(BoardRestarted(ident), FailureReason.BOARD_RESTARTED, events)
        elif ident.nonce == self._nonce:
            self._on_answer(ident, events)
        elif ident.session == 0 and ident.nonce == 0 and self._hello_due_us is not None:
            self._send_hello(self._now_us)

    def _on_answer(self, ident: m.Ident, events: list[HostEvent]) -> None:
        self._hello_due_us = None
        self.board = ident
        if ident.major != m.PROTOCOL_MAJOR or ident.session == 0:
            line = f"protocol: host has {m.PROTOCOL_MAJOR}.{m.PROTOCOL_MINOR}, board has "
            line += f"{ident.major}.{ident.minor} ({ident.firmware})"
            self.incompatible = Incompatible(IncompatibleReason.MAJOR, (line,))
            events.append(self.incompatible)
            return
        self._begin_session(ident.session)
        self._mirror = Mirror()
        events.append(Connected(ident))
        if ident.schema_crc != self._schema_crc:
            self.incompatible = Incompatible(IncompatibleReason.SCHEMA, ())
            self._download = Download()
            self._download_next()

    def _download_next(self) -> None:
        if self._download is not None:
            self._requests.add(self._download.next_request(), internal=True)
            self._send_next_request(self._now_us)

    def _on_description(self, piece: m.Description, events: list[HostEvent]) -> None:
        if self._download is None or self.incompatible is None:
            return
        try:
            description = self._download.add(piece)
            if description is None:
                self._download_next()
                return
            self._foreign = ForeignCodec(description, self._codec)
            fields = differences(self._description, description)
        except SchemaError as error:
            fields = (str(error),)
        self._download = None
        self.incompatible = Incompatible(IncompatibleReason.SCHEMA, fields)
        events.append(self.incompatible)

    def _on_state(self, state: m.State, frame: Frame, events: list[HostEvent]) -> None:
        step = 1 if self._state_seq is None else (frame.seq - self._state_seq) & 0xFF
        if step == 0 or step > 127:
            self.stats.old_states += 1
            return
        self._state_seq = frame.seq
        self.stats.states += 1
        self.stats.missed_states += step - 1
        board_us = self._time.unwrap(state.t_us)
        if self._mirror is not None:
            self._mirror.sample(state.axis, state.mode, board_us)
        pending = None
        if state.valid & ValidBit.SETPOINT:
            pending = self._setpoints.acknowledge(state.axis, state.sp_seq)
            if pending is None:
                self.stats.ack_errors += 1
        if self._estop_wanted:
            self._estop_wanted = state.mode is not BoardState.ESTOP
            if self._estop_wanted:
                self.send_estop()
        events.append(StateReceived(state, board_us, pending))

    def _on_time(self, reply: m.TimeReply, frame: Frame, events: list[HostEvent]) -> None:
        fit = self._time.answer(reply, self._now_us)
        if fit is not None:
            events.append(TimeSynced(fit))

    def _on_stats(self, stats: m.LinkStats, frame: Frame, events: list[HostEvent]) -> None:
        events.append(StatsReceived(stats))

    def _on_fault(self, report: m.FaultReport, frame: Frame, events: list[HostEvent]) -> None:
        key = (report.axis, report.index)
        answered = self._answered(report, frame, events)
        if key not in self._reported and not answered:
            if self._mirror is not None:
                self._mirror.stopped(report.axis, self._time.unwrap(report.t_us))
            events.append(FaultReported(report))
        self._reported.add(key)

    def _on_error(self, error: m.Error, frame: Frame, events: list[HostEvent]) -> None:
        pending = self._requests.in_flight
        number = error.request_type
        if pending and pending.message.info.number == number and pending.seq == error.request_seq:
            self._requests.finish(self._now_us)
            self._timeouts_in_a_row = 0
            self._fail(pending, FailureReason.REFUSED, events, error)
            self._send_next_request(self._now_us)
        else:
            events.append(ErrorReceived(error))

    def _on_reply(self, reply: m.Message, frame: Frame, events: list[HostEvent]) -> None:
        if not self._answered(reply, frame, events):
            self.stats.unmatched_replies += 1

    def _answered(self, reply: m.Message, frame: Frame, events: list[HostEvent]) -> bool:
        pending = self._requests.in_flight
        if pending is None or frame.seq != pending.seq:
            return False
        if type(reply).__name__ not in pending.message.info.replies:
            return False
        self._requests.finish(self._now_us)
        self._timeouts_in_a_row = 0
        self._note_arming(pending.message, reply)
        if pending.internal and isinstance(reply, m.Description):
            self._on_description(reply, events)
        else:
            events.append(RequestDone(pending.id, pending.message, reply))
        self._send_next_request(self._now_us)
        return True

    def _note_arming(self, request: m.Message, reply: m.Message) -> None:
        if self._mirror is None:
            return
        if isinstance(reply, m.ArmToken):
            self._mirror.granted(self._now_us + reply.valid_ms * 1000)
        elif isinstance(request, m.ArmConfirm) and isinstance(reply, m.Done):
            self._mirror.confirmed(request.axis, self._time.unwrap(reply.t_us))
