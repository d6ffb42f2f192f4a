"""Both ends of a session with a line between them, on virtual time."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any, TypeVar

import msgspec

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.board import BoardSession
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.enums import BoardState, ErrorCode, Limiter, ResetCause, ValidBit
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.host import HostSession
from tests.firmware_protocol.lossy import Line

STEP_US = 10_000
WRAP = 1 << 32
TOKEN = 0xA55A0001

IDENT = m.Ident(
    major=m.PROTOCOL_MAJOR,
    minor=m.PROTOCOL_MINOR,
    schema_crc=0,
    param_crc=0,
    nonce=0,
    session=0,
    boot_count=7,
    reset_cause=ResetCause.POWER_ON,
    first_fault=0,
    axes=1,
    capabilities=0x3FF,
    state_rate_hz=100,
    baud=115_200,
    uid=b"0123456789ab",
    firmware="test 1.0",
)

SAMPLE = m.State(
    axis=0,
    t_us=0,
    tick=0,
    mode=BoardState.SAFE,
    limiter=Limiter.NONE,
    faults=0,
    warnings=0,
    i_meas_mA=(0, 0),
    i_applied_mA=(0, 0),
    v_mV=(0, 0),
    pump_duty=(0, 0),
    rtd_cC=(2100, 2150, 2000, 2010),
    encoder_counts=0,
    force_counts=0,
    vbus_mV=12_000,
    valid=0x7FF,
    sp_seq=0,
    sp_age_us=0xFFFF,
)

_Event = TypeVar("_Event")


class TestBoard:
    """A board that does as it is told and remembers how often."""

    __test__ = False

    def __init__(self, *, ident: m.Ident = IDENT, codec: Codec = CODEC, t_us: int = 0) -> None:
        self.ident = ident
        self.session = BoardSession(ident=ident, codec=codec)
        self.session.safe = True
        self.codec = codec
        self.mode = BoardState.SAFE
        self.actions: Counter[tuple[str, int, int]] = Counter()
        self.events: list[e.BoardEvent] = []
        self.setpoint: e.SetpointReceived | None = None
        self.lie = 0
        self.hung = False
        self.t_us = t_us
        self.tick = 0

    def now(self) -> int:
        return self.t_us % WRAP

    def take(self, data: bytes) -> None:
        if self.hung:
            return
        for event in self.session.receive(data, self.t_us):
            self.events.append(event)
            self.act(event)

    def act(self, event: e.BoardEvent) -> None:
        request = getattr(event, "request", None)
        if request is not None:
            self.actions[type(event).__name__, request.session, request.seq] += 1
        if isinstance(event, e.SessionStarted) and self.mode is BoardState.ARMED:
            self.mode = BoardState.COOL
        elif isinstance(event, e.SetpointReceived):
            self.setpoint = event
        elif isinstance(event, e.EstopReceived):
            self.mode = BoardState.ESTOP
        elif isinstance(event, e.ArmRequested):
            self.session.reply(event.request, m.ArmToken(0, TOKEN, 2000), self.t_us)
        elif isinstance(event, e.ArmConfirmed):
            if event.message.token != TOKEN:
                self.session.reject(event.request, ErrorCode.TOKEN_WRONG, now_us=self.t_us)
                return
            self.mode = BoardState.ARMED
            self.session.done(event.request, self.t_us)
        elif isinstance(event, e.DisarmRequested):
            self.mode = BoardState.COOL if self.mode is BoardState.ARMED else self.mode
            self.session.done(event.request, self.t_us)
        elif request is not None:
            (reply,) = request.message.info.replies
            kind = next(kind for kind in m.MESSAGES if kind.__name__ == reply)
            if kind is m.Done:
                self.session.done(request, self.t_us)
            else:
                self.session.reply(request, random_message(kind, random.Random(1)), self.t_us)
        self.session.safe = self.mode is BoardState.SAFE

    def sample(self, base: Any = SAMPLE) -> None:
        if self.hung:
            return
        self.tick += 1
        changes: dict[str, Any] = {"t_us": self.now(), "tick": self.tick & 0xFFFF}
        changes["mode"] = self.mode
        if self.setpoint is not None:
            changes["valid"] = SAMPLE.valid | ValidBit.SETPOINT
            changes["sp_seq"] = (self.setpoint.seq + self.lie) & 0xFF
            changes["sp_age_us"] = self.setpoint.age_us
        self.session.send_state(msgspec.structs.replace(base, **changes))


class Pair:
    """A host and a board; `step` lets ten milliseconds pass at both ends."""

    def __init__(
        self,
        seed: int = 0,
        *,
        board: TestBoard | None = None,
        codec: Codec = CODEC,
        ppm: float = 0.0,
        sample: Any = SAMPLE,
    ) -> None:
        self.rng = random.Random(seed)
        self.host = HostSession(nonce=self.rng.randrange(1 << 32), codec=codec)
        self.board = board or TestBoard()
        self.up = Line(self.rng)
        self.down = Line(self.rng)
        self.now_us = 1_000_000
        self.ppm = ppm
        self.base = sample
        self.events: list[e.HostEvent] = []
        self.control = False
        self.frames_heard: Counter[int] = Counter()
        self._tap = FrameDecoder()
        self._board_start_us = self.board.t_us

    def connect(self) -> Pair:
        self.events += self.host.connect(self.now_us)
        self.run(10)
        return self

    def run(self, steps: int) -> Pair:
        for _ in range(steps):
            self.step()
        return self

    def step(self) -> None:
        self.now_us += STEP_US
        elapsed_us = self.now_us - 1_000_000
        self.board.t_us = self._board_start_us + round(elapsed_us * (1 + self.ppm * 1e-6))
        self.board.sample(self.base)
        self.down.write(self.board.session.data_to_send())
        # Three passes, so that an answer can arrive within the step of its question.
        for _ in range(3):
            self.move()

    def move(self) -> None:
        for piece in self.down.read():
            self.host_hears(piece)
        self.events += self.host.tick(self.now_us)
        self.up.write(self.host.data_to_send())
        for piece in self.up.read():
            self.board.take(piece)
        self.down.write(self.board.session.data_to_send())

    def host_hears(self, data: bytes) -> None:
        self.frames_heard.update(frame.type for frame in self._tap.feed(data))
        for event in self.host.receive(data, self.now_us):
            self.events.append(event)
            if self.control and isinstance(event, e.StateReceived):
                self.host.send_setpoint(setpoint(event.state.t_us))

    def reboot(self, *, announce: bool = True, cause: ResetCause = ResetCause.POWER_ON) -> None:
        old = self.board
        ident = msgspec.structs.replace(
            old.ident,
            major=m.PROTOCOL_MAJOR,
            boot_count=old.ident.boot_count + 1,
            reset_cause=cause,
        )
        self.board = TestBoard(ident=ident, codec=old.codec, t_us=0)
        self._board_start_us = -(self.now_us - 1_000_000)
        if announce:
            self.board.session.boot(0)

    def arm(self) -> Pair:
        ident = self.host.board
        assert ident is not None
        self.ask(m.ArmRequest(axis=0, param_crc=self.board.session.parameters.crc))
        self.ask(m.ArmConfirm(axis=0, token=TOKEN))
        return self

    def ask(self, message: m.Message, steps: int = 30) -> e.RequestDone | e.RequestFailed:
        id_ = self.host.request(message, self.now_us)
        seen = len(self.events)
        for _ in range(steps):
            self.step()
            for event in self.events[seen:]:
                if isinstance(event, e.RequestDone | e.RequestFailed) and event.id == id_:
                    return event
        raise AssertionError(f"{message} was never settled")

    def told(self, kind: type[_Event]) -> list[_Event]:
        return [event for event in self.events if isinstance(event, kind)]


def setpoint(t_ref_us: int, i_mA: tuple[int, int] = (500, 0)) -> m.Setpoint:
    return m.Setpoint(axis=0, t_ref_us=t_ref_us, i_mA=i_mA, pump_duty=(0, 0), flags=0, ttl_ms=100)
