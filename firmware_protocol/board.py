"""The board's end of a session; also the model for a firmware author.

Theory of operation. HELLO with a new nonce begins a session; frames of any other session are
refused, ESTOP and HELLO excepted. Every request has a sequence number, counted from 1 in each
session. The board keeps the last number and the answer it gave: the same number again gets the
same answer again without a second action, an older number is dropped, and a newer one is dropped
while the last is unanswered, so that the host asks again; but DISARM is carried out at once. That
is the whole of "at most once".

What the session knows, it answers by itself: HELLO, DESCRIBE, TIME_REQUEST, PARAM_GET, PARAM_SET,
FAULT_GET. What the board has to decide comes out as an event, to be answered with `reply`, `done`
or `reject`. Bytes received never raise; what is wrong with them is counted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol import rates
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.enums import BoardState, ErrorCode, ValidBit
from firmware_protocol.errors import NotARequestError, PayloadError
from firmware_protocol.framing import Frame, FrameDecoder
from firmware_protocol.outbox import Outbox
from firmware_protocol.parameters import BY_NAME, ParameterRefusedError, ParameterStore
from firmware_protocol.replies import (
    ERRORS_PER_SECOND,
    Budget,
    RequestMemory,
    Verdict,
    error_of,
)
from firmware_protocol.reports import FaultReports
from firmware_protocol.schema import compress, describe, schema_crc
from firmware_protocol.setpoints import SetpointGate
from firmware_protocol.stats import BoardLinkStats
from firmware_protocol.timesync import LOCK_EXCHANGES, WRAP
from firmware_protocol.wire import NO_VALUE

MAX_SETPOINT_AGE_US = 50_000
SLICE = 96


class BoardSession:
    """One host on one port.

    `ident` is a template: the fields that the session knows itself (session, nonce, CRCs, first
    fault) are filled in. `safe` is set by the board: parameters change only while it is True.
    """

    def __init__(
        self,
        *,
        ident: m.Ident,
        parameters: ParameterStore | None = None,
        codec: Codec = CODEC,
        max_setpoint_age_us: int = MAX_SETPOINT_AGE_US,
    ) -> None:
        self.parameters = parameters or ParameterStore(ident.axes)
        self.reports = FaultReports()
        self.session = 0
        self.safe = False
        self.schema_agrees = False
        self._ident = ident
        self._codec = codec
        description = describe(codec)
        self._schema_crc = schema_crc(description)
        self._description = compress(description)
        self._max_age_us = max_setpoint_age_us
        self._decoder = FrameDecoder()
        self.stats = BoardLinkStats(self._decoder.stats)
        self._nonce: int | None = None
        self._now_us = 0
        self._outbox = Outbox()
        self._states: dict[int, m.State] = {}
        self._modes: dict[int, BoardState] = {}
        self._state_seq = 0
        self._stats_seq = 0
        self._complaints = Budget(ERRORS_PER_SECOND)
        self._handlers: dict[
            type[m.Message], Callable[[Any, e.Request, int], e.BoardEvent | None]
        ] = {
            m.Describe: self._on_describe,
            m.ParamGet: self._on_param_get,
            m.ParamSet: self._on_param_set,
            m.ParamSave: self._on_param_save,
            m.FaultGet: self._on_fault_get,
            m.ArmRequest: self._on_arm_request,
            m.ArmConfirm: lambda message, request, _: e.ArmConfirmed(request, message),
            m.Disarm: lambda message, request, _: e.DisarmRequested(request, message),
            m.ClearFault: lambda message, request, _: e.ClearFaultRequested(request, message),
        }
        self._forget_requests()

    @property
    def clock_locked(self) -> bool:
        """Whether the host has asked for the time often enough in this session to know it."""
        return self._exchanges >= LOCK_EXCHANGES

    # For the board

    def boot(self, now_us: int) -> None:
        """Announce the board: IDENT with session 0."""
        self._now_us = now_us
        self._put(self._codec.frame(self._identity(0, 0), 0, 0))

    def receive(self, data: bytes, now_us: int) -> list[e.BoardEvent]:
        """Take in bytes from the port; return what the board has to act on. Never raises."""
        self._now_us = now_us
        events: list[e.BoardEvent] = []
        for frame in self._decoder.feed(data):
            event = self._on_frame(frame, now_us)
            if event is not None:
                events.append(event)
        return events

    def reply(self, request: e.Request, message: m.Message, now_us: int) -> None:
        """Answer a request. Raises NotARequestError for an answer that the table does not list."""
        if type(message).__name__ not in (*request.message.info.replies, "Error"):
            raise NotARequestError(
                f"{type(message).__name__} does not answer {type(request.message).__name__}; "
                f"{' or '.join(request.message.info.replies)} does"
            )
        if request.session != self.session:
            return
        answer = self._codec.frame(message, request.seq, self.session)
        if request.seq == self._memory.seq:
            self._memory.answer = answer
        self._put(answer)

    def done(self, request: e.Request, now_us: int) -> None:
        """Answer that the request was carried out."""
        number = request.message.info.number
        self.reply(request, m.Done(request_type=number, t_us=now_us % WRAP), now_us)

    def reject(
        self,
        request: e.Request,
        code: ErrorCode,
        field: int = m.NO_FIELD,
        limit: int = 0,
        now_us: int = 0,
        *,
        value: int = 0,
    ) -> None:
        """Answer that the request was refused, with the field, the value and the limit."""
        number = request.message.info.number
        self.reply(
            request, error_of(number, request.seq, code, field, value=value, limit=limit), now_us
        )

    def refuse_setpoint(
        self, setpoint: e.SetpointReceived, code: ErrorCode, field: int, limit: int, now_us: int
    ) -> None:
        """Tell the host of a setpoint that the board does not take: the field, and its limit."""
        number, name = m.Setpoint.info.number, m.Setpoint.__struct_fields__[field]
        value = getattr(setpoint.setpoint, name)
        self._complain(number, setpoint.seq, code, now_us, field=field, value=value, limit=limit)

    def send_state(self, state: m.State) -> None:
        """Put a sample in the slot of its axis; one that was not sent yet is replaced."""
        if state.axis in self._states:
            self.stats.dropped_states += 1
        if state.valid & ValidBit.SETPOINT and not self._gate.open_for(state.axis):
            # The setpoint in use came from an earlier session: its number means nothing now.
            state = msgspec.structs.replace(
                state, valid=state.valid & ~ValidBit.SETPOINT, sp_seq=0, sp_age_us=NO_VALUE["u16"]
            )
        self._states[state.axis] = state
        self._modes[state.axis] = state.mode

    def send_fault(self, report: m.FaultReport) -> m.FaultReport:
        """Send a fault now and with the next two samples; return it with its index filled in."""
        numbered = self.reports.add(report)
        self._put(self._codec.frame(numbered, numbered.index, self.session))
        return numbered

    def send_link_stats(self, now_us: int, overruns: int = 0, longest_loop_us: int = 0) -> None:
        """Send the counters of the session, with the loop's from the board."""
        decoder, stats = self.stats.decoder, self.stats
        self._stats_seq = (self._stats_seq + 1) & 0xFF
        message = m.LinkStats(
            frames=decoder.frames % WRAP,
            crc_errors=decoder.crc_errors % WRAP,
            cobs_errors=decoder.cobs_errors % WRAP,
            length_errors=decoder.length_errors % WRAP,
            payload_errors=stats.payload_errors % WRAP,
            session_errors=stats.session_errors % WRAP,
            stale_setpoints=stats.stale_setpoints % WRAP,
            repeated_requests=stats.repeated_requests % WRAP,
            dropped_states=stats.dropped_states % WRAP,
            overruns=overruns % WRAP,
            longest_loop_us=min(longest_loop_us, WRAP - 1),
        )
        self._put(self._codec.frame(message, self._stats_seq, self.session))

    def data_to_send(self) -> bytes:
        """Return all bytes to write now; a second call returns none."""
        if self._states:
            for state in self._states.values():
                self._state_seq = (self._state_seq + 1) & 0xFF
                self._put(self._codec.frame(state, self._state_seq, self.session))
            self._states.clear()
            for report in self.reports.repeats():
                self._put(self._codec.frame(report, report.index, self.session))
        return self._outbox.take(self._now_us)

    # Frames

    def _on_frame(self, frame: Frame, now_us: int) -> e.BoardEvent | None:
        if frame.type >= m.FIRST_BOARD_NUMBER:
            self.stats.echoes += 1
            return None
        try:
            message = self._codec.unpack(frame.type, frame.payload)
        except PayloadError:
            self.stats.payload_errors += 1
            known = self._codec.knows(frame.type)
            code = ErrorCode.BAD_PAYLOAD if known else ErrorCode.UNKNOWN_TYPE
            self._complain(frame.type, frame.seq, code, now_us, value=len(frame.payload))
            return None
        if isinstance(message, m.Estop):
            return e.EstopReceived()
        if isinstance(message, m.Hello):
            return self._on_hello(message, frame, now_us)
        if self.session == 0 or frame.session != self.session:
            self.stats.session_errors += 1
            code, ours = ErrorCode.NO_SESSION, self.session
            self._complain(frame.type, frame.seq, code, now_us, value=frame.session, limit=ours)
            return None
        if not self.schema_agrees and not message.info.frozen:
            self._complain(frame.type, frame.seq, ErrorCode.SCHEMA_DIFFERS, now_us)
            return None
        if isinstance(message, m.TimeRequest):
            stamp = now_us % WRAP
            reply = m.TimeReply(t1_us=message.t1_us, t2_us=stamp, t3_us=stamp)
            self._put(self._codec.frame(reply, frame.seq, self.session))
            self._exchanges += 1
            return None
        if isinstance(message, m.Setpoint):
            return self._on_setpoint(message, frame, now_us)
        return self._on_request(message, frame, now_us)

    def _on_hello(self, hello: m.Hello, frame: Frame, now_us: int) -> e.BoardEvent | None:
        if hello.major != self._ident.major:
            self._put(self._codec.frame(self._identity(0, hello.nonce), frame.seq, 0))
            return None
        event = None
        if self.session == 0 or hello.nonce != self._nonce:
            self.session = (self.session or self._ident.boot_count * 257 + 1) % 0xFFFF + 1
            self._nonce = hello.nonce
            self.schema_agrees = hello.schema_crc == self._schema_crc
            self._forget_requests()
            event = e.SessionStarted(self.session, self.schema_agrees)
        answer = self._identity(self.session, hello.nonce)
        self._put(self._codec.frame(answer, frame.seq, self.session))
        return event

    def _on_setpoint(self, setpoint: m.Setpoint, frame: Frame, now_us: int) -> e.BoardEvent | None:
        if setpoint.axis >= self._ident.axes:
            event = e.SetpointReceived(setpoint, frame.seq, 0)
            code, last = ErrorCode.NO_SUCH_AXIS, self._ident.axes - 1
            self.refuse_setpoint(event, code, 0, last, now_us)
            return None
        age_us = self._gate.admit(setpoint.axis, setpoint.t_ref_us, frame.seq, now_us)
        if age_us is None:
            self.stats.stale_setpoints += 1
            return None
        return e.SetpointReceived(setpoint, frame.seq, age_us)

    def _on_request(self, message: m.Message, frame: Frame, now_us: int) -> e.BoardEvent | None:
        handler = self._handlers.get(type(message))
        if handler is None:
            self.stats.unhandled += 1
            self._complain(frame.type, frame.seq, ErrorCode.UNKNOWN_TYPE, now_us)
            return None
        verdict = self._memory.judge(frame.seq, urgent=isinstance(message, m.Disarm))
        if verdict is Verdict.BUSY:
            self.stats.busy_requests += 1
        elif verdict is not Verdict.NEW:
            self.stats.repeated_requests += 1
        if verdict is Verdict.REPEATED and self._memory.answer:
            self._put(self._memory.answer)
        if verdict is not Verdict.NEW:
            return None
        request = e.Request(message, frame.seq, self.session)
        axis = getattr(message, "axis", 0)
        if axis >= self._ident.axes:
            limit = self._ident.axes - 1
            self.reject(request, ErrorCode.NO_SUCH_AXIS, 0, limit, now_us, value=axis)
            return None
        return handler(message, request, now_us)

    # Requests that the session answers itself

    def _on_describe(self, message: m.Describe, request: e.Request, now_us: int) -> None:
        piece = self._description[message.offset : message.offset + SLICE]
        total = len(self._description)
        self.reply(request, m.Description(message.offset, total, len(piece), piece), now_us)

    def _on_param_get(self, message: m.ParamGet, request: e.Request, now_us: int) -> None:
        self._answer_parameter(request, message.axis, message.param, now_us)

    def _on_param_set(
        self, message: m.ParamSet, request: e.Request, now_us: int
    ) -> e.ParameterChanged | None:
        if not self.safe:
            self._reject_state(request, now_us)
            return None
        try:
            self._check_rate(message)
            self.parameters.set(message.axis, message.param, message.value)
        except ParameterRefusedError as refused:
            self.reject(request, refused.code, 2, refused.limit, now_us, value=refused.value)
            return None
        self._answer_parameter(request, message.axis, message.param, now_us)
        name = self.parameters.find(message.axis, message.param).name
        return e.ParameterChanged(message.axis, name, message.value)

    def _on_param_save(
        self, message: m.ParamSave, request: e.Request, now_us: int
    ) -> e.ParameterSaveRequested | None:
        if not self.safe:
            self._reject_state(request, now_us)
            return None
        return e.ParameterSaveRequested(request, message)

    def _check_rate(self, message: m.ParamSet) -> None:
        if message.param != BY_NAME["state_rate_hz"].number:
            return
        most_hz = rates.most_rate_hz(self._ident.baud, self._ident.axes)
        if message.value > most_hz:
            raise ParameterRefusedError(
                f"{message.value} Hz do not fit {self._ident.baud} Bd",
                ErrorCode.RATE_TOO_HIGH,
                message.value,
                most_hz,
            )

    def _reject_state(self, request: e.Request, now_us: int) -> None:
        other_state = next((mode for mode in self._modes.values() if mode != BoardState.SAFE), 0)
        self.reject(
            request, ErrorCode.WRONG_STATE, m.NO_FIELD, BoardState.SAFE, now_us, value=other_state
        )

    def _answer_parameter(self, request: e.Request, axis: int, number: int, now_us: int) -> None:
        try:
            row = self.parameters.find(axis, number)
        except ParameterRefusedError as refused:
            self.reject(request, refused.code, 1, refused.limit, now_us, value=refused.value)
            return
        value = self.parameters.values[axis, number]
        self.reply(
            request,
            m.ParamValue(
                axis, number, row.kind, value, row.minimum, row.maximum, self.parameters.crc
            ),
            now_us,
        )

    def _on_fault_get(self, message: m.FaultGet, request: e.Request, now_us: int) -> None:
        report = self.reports.get(message.axis, message.index)
        if report is None:
            limit = self.reports.count(message.axis)
            self.reject(request, ErrorCode.NO_SUCH_REPORT, 1, limit, now_us, value=message.index)
            return
        self.reply(request, report, now_us)

    def _on_arm_request(
        self, message: m.ArmRequest, request: e.Request, now_us: int
    ) -> e.ArmRequested | None:
        if message.param_crc != self.parameters.crc:
            self.reject(request, ErrorCode.PARAMETERS_DIFFER, now_us=now_us)
            return None
        return e.ArmRequested(request, message)

    # Small things

    def _put(self, frame: bytes) -> None:
        if not self._outbox.add(frame):
            self.stats.dropped_frames += 1

    def _forget_requests(self) -> None:
        self._memory = RequestMemory()
        self._gate = SetpointGate(self._max_age_us)
        self._exchanges = 0

    def _identity(self, session: int, nonce: int) -> m.Ident:
        return msgspec.structs.replace(
            self._ident,
            schema_crc=self._schema_crc,
            param_crc=self.parameters.crc,
            state_rate_hz=self.parameters.get("state_rate_hz"),
            nonce=nonce,
            session=session,
            first_fault=self.reports.first_fault,
        )

    def _complain(
        self,
        number: int,
        seq: int,
        code: ErrorCode,
        now_us: int,
        *,
        field: int = m.NO_FIELD,
        value: int = 0,
        limit: int = 0,
    ) -> None:
        if not self._complaints.spend(now_us):
            self.stats.dropped_errors += 1
            return
        error = error_of(number, seq, code, field, value=value, limit=limit)
        self._put(self._codec.frame(error, seq, self.session))
