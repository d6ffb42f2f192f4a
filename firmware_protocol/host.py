"""The host's end of a session: everything that decides what goes on the line lives here.

Theory of operation. `connect` sends HELLO until IDENT echoes its nonce; from then on frames carry
the session number that IDENT gave. STATE frames come by themselves. A setpoint waits in one slot,
so that only the latest is ever sent. Requests go one at a time and are repeated; the board
answers a repeat from its memory, so they act at most once. DISARM overtakes all others.

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

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.description import Reader
from firmware_protocol.enums import BoardState, ResetCause, ValidBit
from firmware_protocol.errors import (
    NotAllowedError,
    NotARequestError,
    NotConnectedError,
)
from firmware_protocol.framing import DELIMITER, Frame, FrameDecoder, encode_frame
from firmware_protocol.greeting import Greeting
from firmware_protocol.mirror import Mirror
from firmware_protocol.outbox import Outbox
from firmware_protocol.reports import ReportsSeen
from firmware_protocol.requests import Pending, RequestQueue
from firmware_protocol.samples import SampleOrder
from firmware_protocol.schema import describe, schema_crc
from firmware_protocol.setpoints import SetpointSlot
from firmware_protocol.stats import HostLinkStats
from firmware_protocol.timesync import ClockFit, TimeExchanges

SILENCE_US = 500_000
"""A session without a sample for so long is over."""

FOREIGN_LIMIT = 3
TIMEOUT_LIMIT = 3
ESTOP_COPIES = 3

# A plain number: arithmetic on members builds members, on the hot path of every sample.
_SETPOINT_VALID = ValidBit.SETPOINT.value


class HostSession:
    """One board on one port: bytes and time in, bytes and events out.

    `nonce` should differ from run to run (a random number): it tells the board's answers to this
    host from those to an earlier one. `now_us` is any monotonic clock. `patience` multiplies how
    long a silent board is waited for: 1 is right for a bench; more is for a simulated board that
    runs on virtual time, where a busy machine keeps it from answering and nothing moves meanwhile.
    `axis` is the one that the host uses (None: all): samples of others are counted, and are no sign
    of life; their faults are not told.
    """

    def __init__(
        self, *, nonce: int, codec: Codec = CODEC, patience: int = 1, axis: int | None = None
    ) -> None:
        self._axis = axis
        self._silence_us = patience * SILENCE_US
        self._timeout_limit = patience * TIMEOUT_LIMIT
        self.board: m.Ident | None = None
        self.incompatible: e.Incompatible | None = None
        self.session = 0
        self._codec = codec
        self._description = describe(codec)
        self._schema_crc = schema_crc(self._description)
        self._greeting = Greeting(nonce, self._schema_crc)
        self._decoder = FrameDecoder()
        self.stats = HostLinkStats(self._decoder.stats)
        self._outbox = Outbox()
        self._open = False
        self._mirror: Mirror | None = None
        self._now_us = 0
        self._time = TimeExchanges()
        self._estop_wanted = False
        self._reports = ReportsSeen()
        self._handlers: dict[type[m.Message], Callable[[Any, Frame, list[e.HostEvent]], None]] = {
            m.State: self._on_state,
            m.Ident: self._on_ident,
            m.Error: self._on_error,
            m.FaultReport: self._on_fault,
            m.TimeReply: self._on_time,
            m.LinkStats: lambda stats, _, events: events.append(e.StatsReceived(stats)),
            m.Description: self._on_reply,
            m.ArmToken: self._on_reply,
            m.Done: self._on_reply,
            m.ParamValue: self._on_reply,
        }
        self._requests = RequestQueue(self._send, self.stats)
        self._begin_session(0)

    @property
    def state(self) -> e.HostState:
        """Where the host stands with its board."""
        if not self._open:
            return e.HostState.DISCONNECTED
        return e.HostState.SYNC if self._mirror is None else self._mirror.state

    @property
    def clock(self) -> ClockFit | None:
        """Board time to host time, None before the first exchange."""
        return self._time.sync.fit

    def host_us(self, t_us: int) -> float | None:
        """Return when, by this host's clock, the board's last showed `t_us`; None if unknown."""
        return self._time.host_us(t_us, self._now_us)

    def connect(self, now_us: int) -> list[e.HostEvent]:
        """Begin on a port just opened: HELLO, repeated until the board answers.

        Returns the failures of the requests that waited in a session not closed with `lost`.
        """
        events = self.lost(now_us)
        self._open = True
        self._decoder.reset()
        self._greet(now_us)
        return events

    def lost(self, now_us: int) -> list[e.HostEvent]:
        """The port went away. Returns the failures of the requests that were waiting."""
        self._now_us = now_us
        events: list[e.HostEvent] = []
        self._end_session(e.FailureReason.LINK_LOST, events)
        self._open = False
        self._greeting.stop()
        self._outbox.reopen()
        return events

    def receive(self, data: bytes, now_us: int) -> list[e.HostEvent]:
        """Take in bytes from the port; return what they mean. Never raises."""
        self._now_us = now_us
        events: list[e.HostEvent] = []
        if self._open:
            for frame in self._decoder.feed(data):
                self._on_frame(frame, events)
            self._run_timers(now_us, events)
        return events

    def tick(self, now_us: int) -> list[e.HostEvent]:
        """Repeat what was not answered and give up what never will be."""
        self._now_us = now_us
        events: list[e.HostEvent] = []
        if self._open:
            self._run_timers(now_us, events)
        return events

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
        return self._requests.add(message, now_us, urgent=isinstance(message, m.Disarm))

    def withdraw_arming(self, now_us: int) -> list[e.HostEvent]:
        """Give up every request to arm, waiting or in flight; return their failures.

        One in flight may still arm the board: a Disarm asked for after this is carried out later.
        """
        self._now_us = now_us
        events: list[e.HostEvent] = []
        for pending in self._requests.withdraw((m.ArmRequest, m.ArmConfirm), now_us):
            self._fail(pending, e.FailureReason.WITHDRAWN, events)
        if self._mirror is not None:
            self._mirror.refused()
        return events

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
        self._outbox.add_urgent(self._codec.frame(m.Estop(), 0, self.session) * ESTOP_COPIES)

    def data_to_send(self) -> bytes:
        """Return all bytes to write now; a second call returns none."""
        for seq, payload in self._setpoints.take():
            self._outbox.add(encode_frame(m.Setpoint.info.number, seq, self.session, payload))
            self.stats.setpoints_sent += 1
        return self._outbox.take(self._now_us)

    # Beginnings and endings

    def _begin_session(self, number: int) -> None:
        self.session = number
        self._setpoints = SetpointSlot()
        self._reader = Reader(self._codec, self._description)
        self._samples = SampleOrder(self.stats)
        self._strangers = 0
        self._heard_us = self._now_us
        self.incompatible = None

    def _end_session(self, reason: e.FailureReason, events: list[e.HostEvent]) -> None:
        for pending in self._requests.drop_all():
            self._fail(pending, reason, events)
        self._begin_session(0)
        self._mirror = None

    def _greet(self, now_us: int) -> None:
        self._greeting.renew()
        self._send_hello(now_us)

    def _restart(
        self, event: e.HostEvent, reason: e.FailureReason, events: list[e.HostEvent]
    ) -> None:
        self._end_session(reason, events)
        events.append(event)
        self._greet(self._now_us)

    def _send_hello(self, now_us: int) -> None:
        seq = self._greeting.count & 0xFF
        frame = self._codec.frame(self._greeting.hello(now_us), seq, 0)
        self._outbox.add(DELIMITER + frame)

    # Timers

    def _run_timers(self, now_us: int, events: list[e.HostEvent]) -> None:
        if self._greeting.due_us is not None:
            if now_us >= self._greeting.due_us:
                self._send_hello(now_us)
            return
        if self._mirror is None:
            return
        self._mirror.tick(now_us)
        if now_us - self._heard_us >= self._silence_us:
            silent_us = now_us - self._heard_us
            self._restart(e.LinkLost(silent_us), e.FailureReason.LINK_LOST, events)
            return
        if (given_up := self._requests.tick(now_us)) is not None:
            self._on_timeout(given_up, now_us, events)
        if self._mirror is not None and self.incompatible is None and now_us >= self._time.due_us:
            self._send(self._time.ask(now_us), 0)

    def _on_timeout(self, given_up: Pending, now_us: int, events: list[e.HostEvent]) -> None:
        self.stats.timeouts += 1
        self._fail(given_up, e.FailureReason.TIMEOUT, events)
        if self._requests.timeouts_in_a_row >= self._timeout_limit:
            # Its sequence numbers and ours may have drifted too far apart to be trusted.
            self._restart(e.LinkLost(now_us - self._heard_us), e.FailureReason.LINK_LOST, events)
        elif given_up.internal:
            self._requests.add(given_up.message, now_us, internal=True)

    # Requests

    def _send(self, message: m.Message, seq: int) -> None:
        self._outbox.add(self._codec.frame(message, seq, self.session))

    def _fail(
        self,
        pending: Pending,
        reason: e.FailureReason,
        events: list[e.HostEvent],
        error: m.Error | None = None,
    ) -> None:
        if isinstance(pending.message, m.ArmConfirm) and self._mirror is not None:
            self._mirror.refused()
        if not pending.internal:
            events.append(e.RequestFailed(pending.id, pending.message, reason, error))

    # Frames

    def _on_frame(self, frame: Frame, events: list[e.HostEvent]) -> None:
        if frame.type < m.FIRST_BOARD_NUMBER:
            self.stats.echoes += 1
            return
        if self._mirror is None and frame.type != m.Ident.info.number:
            return
        if frame.session == self.session and not self._reader.understood:
            self._heard_us = self._now_us
        message = self._reader.read(frame, self.stats)
        if message is None:
            return
        if type(message) is not m.Ident:
            if frame.session != self.session:
                self._on_stranger(events)
                return
            self._strangers = 0
        handler = self._handlers.get(type(message))
        if handler is None:
            self.stats.unhandled += 1
            return
        handler(message, frame, events)

    def _on_stranger(self, events: list[e.HostEvent]) -> None:
        self.stats.session_errors += 1
        self._strangers += 1
        if self._strangers >= FOREIGN_LIMIT:
            self._restart(e.BoardRestarted(None), e.FailureReason.BOARD_RESTARTED, events)

    def _on_ident(self, ident: m.Ident, frame: Frame, events: list[e.HostEvent]) -> None:
        if self._mirror is not None:
            if ident.session == 0 and not self._is_known(ident):
                self._restart(e.BoardRestarted(ident), e.FailureReason.BOARD_RESTARTED, events)
        elif ident.nonce == self._greeting.nonce:
            self._on_answer(ident, events)
        elif ident.session == 0 and ident.nonce == 0:
            self._greeting.count = 0
            self._send_hello(self._now_us)

    def _on_answer(self, ident: m.Ident, events: list[e.HostEvent]) -> None:
        self._greeting.stop()
        if not self._is_known(ident):
            self._time = TimeExchanges()
            self._reports = ReportsSeen()
            before = self.board
            # Only a power cycle, or another board, ends an ESTOP that no board has confirmed.
            self._estop_wanted &= before is None or (
                before.uid == ident.uid and ident.reset_cause is not ResetCause.POWER_ON
            )
        self.board = ident
        if ident.major != m.PROTOCOL_MAJOR or ident.session == 0:
            line = f"protocol: host has {m.PROTOCOL_MAJOR}.{m.PROTOCOL_MINOR}, board has "
            line += f"{ident.major}.{ident.minor} ({ident.firmware})"
            self.incompatible = e.Incompatible(e.IncompatibleReason.MAJOR, (line,))
            events.append(self.incompatible)
            return
        self._begin_session(ident.session)
        self._time.begin(self._now_us)
        self._mirror = Mirror()
        events.append(e.Connected(ident))
        if ident.schema_crc != self._schema_crc:
            self.incompatible = e.Incompatible(e.IncompatibleReason.SCHEMA, ())
            self._requests.add(self._reader.begin_download(), self._now_us, internal=True)

    def _is_known(self, ident: m.Ident) -> bool:
        """Whether it is the board of the session before, and has not restarted since."""
        board = self.board
        return board is not None and (board.uid, board.boot_count) == (ident.uid, ident.boot_count)

    def _on_description(self, piece: m.Description, events: list[e.HostEvent]) -> None:
        lines = self._reader.add(piece)
        request = self._reader.next_request()
        if request is not None:
            self._requests.add(request, self._now_us, internal=True)
        elif lines is not None:
            self.incompatible = e.Incompatible(e.IncompatibleReason.SCHEMA, lines)
            events.append(self.incompatible)

    def _on_state(self, state: m.State, frame: Frame, events: list[e.HostEvent]) -> None:
        if self._axis is not None and state.axis != self._axis:
            self.stats.other_axes += 1
            return
        if not self._samples.accept(state):
            return
        self._heard_us = self._now_us
        board_us = self._time.unwrap(state.t_us, self._now_us)
        if self._mirror is not None:
            self._mirror.sample(state.axis, state.mode, board_us)
        pending = None
        if state.valid & _SETPOINT_VALID:
            pending = self._setpoints.acknowledge(state.axis, state.sp_seq)
            if pending is None:
                self.stats.ack_errors += 1
        self._estop_wanted &= state.mode is not BoardState.ESTOP
        if self._estop_wanted:
            self.send_estop()
        events.append(e.StateReceived(state, board_us, pending))

    def _on_time(self, reply: m.TimeReply, frame: Frame, events: list[e.HostEvent]) -> None:
        if (fit := self._time.answer(reply, self._now_us)) is not None:
            events.append(e.TimeSynced(fit))

    def _on_fault(self, report: m.FaultReport, frame: Frame, events: list[e.HostEvent]) -> None:
        is_new = self._reports.note(report)
        used = self._axis is None or report.axis == self._axis
        if self._answered(report, frame, events) or not (is_new and used):
            return
        if self._mirror is not None:
            t_us = self._time.unwrap(report.t_us, self._now_us)
            self._mirror.stopped(report.axis, t_us)
        events.append(e.FaultReported(report))

    def _on_error(self, error: m.Error, frame: Frame, events: list[e.HostEvent]) -> None:
        pending = self._requests.refused(error.request_type, error.request_seq, self._now_us)
        if pending is None:
            events.append(e.ErrorReceived(error))
        else:
            self._fail(pending, e.FailureReason.REFUSED, events, error)

    def _on_reply(self, reply: m.Message, frame: Frame, events: list[e.HostEvent]) -> None:
        if not self._answered(reply, frame, events):
            self.stats.unmatched_replies += 1

    def _answered(self, reply: m.Message, frame: Frame, events: list[e.HostEvent]) -> bool:
        if (pending := self._requests.answered(reply, frame.seq, self._now_us)) is None:
            return False
        self._note_arming(pending.message, reply)
        if pending.internal and isinstance(reply, m.Description):
            self._on_description(reply, events)
        else:
            events.append(e.RequestDone(pending.id, pending.message, reply))
        return True

    def _note_arming(self, request: m.Message, reply: m.Message) -> None:
        if self._mirror is None:
            return
        if isinstance(reply, m.ArmToken):
            self._mirror.granted(self._now_us + reply.valid_ms * 1000)
        elif isinstance(request, m.ArmConfirm) and isinstance(reply, m.Done):
            self._mirror.confirmed(request.axis, self._time.unwrap(reply.t_us, self._now_us))
        elif isinstance(request, m.Disarm) and isinstance(reply, m.Done):
            self._mirror.disarmed(request.axis, self._time.unwrap(reply.t_us, self._now_us))
