"""The host's end, with the daemon's control task on it: whatever a board says, no current unarmed.

The controller always wants current. What leaves is read back from the bytes: a SETPOINT with
current may only be there while the session is RUNNING, which takes an answered ARM_CONFIRM.
"""

from __future__ import annotations

from collections.abc import Callable

from campaign.fuzz.program import Program, require
from campaign.fuzz.setpoints import check_setpoints
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import Fault
from firmware_protocol.errors import NotAllowedError, NotConnectedError, QueueFullError
from firmware_protocol.events import Connected, HostEvent, HostState, RequestDone
from firmware_protocol.framing import MAX_PAYLOAD, FrameDecoder, encode_frame
from firmware_protocol.host import HostSession
from firmware_protocol.wire import Direction
from smad.config import Config, LinkConfig
from smad.control.commands import DriveCurrent
from smad.control.controller import Controller
from smad.daemon.control import ControlOutputs, ControlTask
from smad.daemon.services import Clocks
from tests.firmware_protocol.pair import SAMPLE, TOKEN, TestBoard

WANTED = DriveCurrent(i_x_A=1.5, i_y_A=0.5, pump_y_duty=0.5)
MOST_OUTPUT_BYTES = 2 * 8192 + 4096
"""The outbox keeps 8192 bytes and as many urgent ones, the last of each being let through."""

_FROM_BOARD = tuple(
    CODEC.layouts[number]
    for number in sorted(CODEC.layouts)
    if CODEC.layouts[number].cls.info.direction is Direction.TO_HOST
)
_REQUESTS: tuple[m.Message, ...] = (
    m.Disarm(0),
    m.ParamGet(0, 1),
    m.ParamSave(),
    m.FaultGet(0, 0),
    m.ClearFault(0, Fault(1)),
    m.ArmConfirm(0, TOKEN),
    m.Describe(0),
)


def run(data: bytes) -> None:
    """The input is a program: frames, samples, requests, time, the port going and coming."""
    _Line().play(Program(data))


class _Line:
    """A host, a board that does as it is told, and whatever else is said on the line."""

    def __init__(self) -> None:
        self.now_us = 1_000_000
        self.board = TestBoard(t_us=1_000_000)
        self.control = ControlTask(
            HostSession(nonce=9),
            Controller(Config().control),
            LinkConfig(setpoint_ttl_ms=100),
            ControlOutputs(self._written, self._on_event, lambda: None),
            Clocks(lambda: self.now_us, lambda: 0.0, lambda: self.now_us * 1000),
        )
        self._tap = FrameDecoder()
        self._last_seq = 0
        self._confirmed = False
        self._ops: tuple[Callable[[Program], None], ...] = (
            self._raw,
            self._frame,
            self._message,
            self._wait,
            self._sample,
            self._ask,
            self._arm,
            self._port,
        )
        self.control.opened()
        self._exchange()

    def play(self, program: Program) -> None:
        while program:
            self._ops[program.u8() % len(self._ops)](program)
            self._check()

    # What the input can ask for

    def _raw(self, program: Program) -> None:
        self.control.receive(program.take(program.u8()))

    def _frame(self, program: Program) -> None:
        number, size = program.u8(), program.u8() % (MAX_PAYLOAD + 1)
        self._say(number, program, program.take(size))

    def _message(self, program: Program) -> None:
        layout = _FROM_BOARD[program.u8() % len(_FROM_BOARD)]
        self._say(layout.number, program, program.take(layout.size))

    def _say(self, number: int, program: Program, payload: bytes) -> None:
        selector = program.u8()
        seq = self._last_seq if selector & 1 else selector
        session = program.u16() if selector & 2 else self.control.session.session
        self.control.receive(encode_frame(number, seq, session, payload))

    def _wait(self, program: Program) -> None:
        self._pass_time(program.u8() * 5000)
        self.control.tick()

    def _sample(self, program: Program) -> None:
        for _ in range(program.u8() % 8 + 1):
            self._pass_time(10_000)
            self.board.sample(SAMPLE)
            self._exchange()

    def _ask(self, program: Program) -> None:
        session = self.control.session
        try:
            session.request(_REQUESTS[program.u8() % len(_REQUESTS)], self.now_us)
        except (NotConnectedError, NotAllowedError, QueueFullError):
            return
        self._exchange()

    def _arm(self, program: Program) -> None:
        session = self.control.session
        crc = self.board.session.parameters.crc
        for request in (m.ArmRequest(0, crc), m.ArmConfirm(0, TOKEN)):
            try:
                session.request(request, self.now_us)
            except (NotConnectedError, NotAllowedError, QueueFullError):
                return
            self._exchange()

    def _port(self, program: Program) -> None:
        what = program.u8() % 4
        if what == 0:
            self.control.lost()
        elif what == 1:
            self.control.opened()
        elif what == 2:
            self.control.session.data_to_send()
            if self.control.session.state is not HostState.DISCONNECTED:
                self.control.session.send_estop()
        else:
            self.board = TestBoard(t_us=0)
            self.board.session.boot(0)
        self._exchange()

    # The line

    def _pass_time(self, span_us: int) -> None:
        self.now_us += span_us
        self.board.t_us += span_us

    def _exchange(self) -> None:
        for _ in range(3):
            self.control.flush()
            self.control.receive(self.board.session.data_to_send())
        # Nobody but the board ends a mode; the controller wants current whenever it may.
        self.control.controller.command(WANTED)

    def _written(self, data: bytes) -> bool:
        require(len(data) <= MOST_OUTPUT_BYTES, "{} bytes wait to be sent", len(data))
        frames = self._tap.feed(data)
        if frames:
            self._last_seq = frames[-1].seq
        check_setpoints(frames, self.control.session)
        self.board.take(data)
        return True

    def _on_event(self, event: HostEvent) -> None:
        require(isinstance(event, HostEvent), "{!r} is no event", event)
        if isinstance(event, Connected):
            self._confirmed = False
        elif isinstance(event, RequestDone) and isinstance(event.request, m.ArmConfirm):
            self._confirmed |= isinstance(event.reply, m.Done)

    def _check(self) -> None:
        session = self.control.session
        require(
            self._confirmed or session.state is not HostState.RUNNING,
            "RUNNING without an ARM_CONFIRM answered in this session",
        )
        self.control.finished.clear()
