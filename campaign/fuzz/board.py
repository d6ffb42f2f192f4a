"""The board's end, with the supervisor behind it: whatever a host says, no current unarmed.

The board is the simulated one without its plant: readings come from the input, as integers that
the fuzzer chooses. ARMED may only be reached through a confirmation with the token last granted,
and a fresh setpoint is always let in, however long the pause before it. `bench` has the plant too.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from campaign.fuzz.program import Program, require
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState
from firmware_protocol.framing import MAX_PAYLOAD, FrameDecoder, encode_frame
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.schema import own_crc
from firmware_protocol.wire import Direction
from sim_device.board import CAPABILITIES, Board
from sim_device.plant import Readings

AT_REST = Readings(
    i_A=(0.0, 0.0),
    v_V=(0.0, 0.0),
    rtd_degC=(21.0, 21.5, 20.0, 20.1),
    displacement_m=0.0,
    force_N=1.0,
    supply_V=12.0,
)
FIXTURES = tuple(CAPABILITIES)
MOST_OUTPUT_BYTES = 8192 + 1024
_PERIOD_US = 10_000
_HOT = (BoardState.ARMED, BoardState.HOLD)
_FROM_HOST = tuple(
    CODEC.layouts[number]
    for number in sorted(CODEC.layouts)
    if CODEC.layouts[number].cls.info.direction is Direction.TO_BOARD
)


def run(data: bytes) -> None:
    """The input is the fixture, then a program: frames, a host's requests, readings, time."""
    program = Program(data)
    BoardHarness(FIXTURES[program.u8() % len(FIXTURES)]).play(program)


class BoardHarness:
    """A board with a host that can do everything right, and whoever else writes to the line."""

    def __init__(self, fixture: str) -> None:
        self.now_us = 0
        self.power_up(fixture)
        self._heard = FrameDecoder()
        self._said = FrameDecoder()
        self._seq = 0
        self._token: int | None = None
        self._confirmed: set[int] = set()
        self._was = self.board.state
        self._readings = AT_REST
        self._ops: tuple[Callable[[Program], None], ...] = (
            self._raw,
            self._frame,
            self._message,
            self._samples,
            self._greet,
            self._arm,
            self._setpoint,
            self._measure,
            self._confirm,
            self._drive,
            self._pause,
        )
        self._step(6)

    # What there is to drive

    def power_up(self, fixture: str) -> None:
        """Make the board."""
        self.made = Board(fixture=fixture, seed=3)

    @property
    def board(self) -> Board:
        """The board in use."""
        return self.made

    def deliver(self, data: bytes) -> None:
        """Hand bytes from the host to the board."""
        self.board.receive(data, self.now_us)

    def sample(self) -> m.State | None:
        """Take a sample at the present time; None if the board took none."""
        return self.board.sample(self._readings, self.now_us)

    def play(self, program: Program) -> None:
        while program:
            self._ops[program.u8() % len(self._ops)](program)
            self._check_parameters()

    # What the input can ask for

    def _raw(self, program: Program) -> None:
        self._send(program.take(program.u8()))

    def _frame(self, program: Program) -> None:
        number, size = program.u8(), program.u8() % (MAX_PAYLOAD + 1)
        self._say(number, program, program.take(size))

    def _message(self, program: Program) -> None:
        layout = _FROM_HOST[program.u8() % len(_FROM_HOST)]
        self._say(layout.number, program, program.take(layout.size))

    def _say(self, number: int, program: Program, payload: bytes) -> None:
        selector = program.u8()
        self._seq = (self._seq + 1) & 0xFF if selector & 1 else selector
        session = program.u16() if selector & 2 else self.board.session.session
        self._send(encode_frame(number, self._seq, session, payload))

    def _samples(self, program: Program) -> None:
        self._step(program.u8() % 40 + 1)

    def _greet(self, program: Program) -> None:
        hello = m.Hello(m.PROTOCOL_MAJOR, m.PROTOCOL_MINOR, own_crc(), program.u8())
        self._send(CODEC.frame(hello, 0, 0))
        self._seq = 0
        for _ in range(8):
            self._request(m.TimeRequest(self.now_us & 0xFFFF_FFFF))

    def _arm(self, program: Program) -> None:
        self._request(m.ArmRequest(0, self.board.parameters.crc))
        if self._token is not None:
            self._request(m.ArmConfirm(0, self._token))

    def _setpoint(self, program: Program) -> None:
        setpoint = m.Setpoint(
            axis=0,
            t_ref_us=0,
            i_mA=(program.u8() * 16, program.u8() * 16),
            pump_duty=(program.u8(), 0),
            flags=0,
            ttl_ms=program.u8(),
        )
        self._send_fresh(setpoint)

    def _drive(self, program: Program) -> None:
        """A setpoint on time with any numbers in it."""
        layout = CODEC.layout(m.Setpoint)
        drawn: m.Setpoint = layout.unpack(program.take(layout.size))
        self._send_fresh(msgspec.structs.replace(drawn, axis=0))

    def _send_fresh(self, setpoint: m.Setpoint) -> None:
        """Send a setpoint that answers a sample of this moment."""
        self._step(1)
        t_ref_us = self.board.now_us & 0xFFFF_FFFF
        stats = self.board.session.stats
        before = stats.stale_setpoints
        self._request(msgspec.structs.replace(setpoint, t_ref_us=t_ref_us))
        require(stats.stale_setpoints == before, "the newest setpoint was taken for an old one")
        self._step(1)

    def _confirm(self, program: Program) -> None:
        """A confirmation with any token, after a request or without one."""
        if program.u8() & 1:
            self._request(m.ArmRequest(0, self.board.parameters.crc))
        self._request(m.ArmConfirm(0, int.from_bytes(program.take(4), "little")))

    def _pause(self, program: Program) -> None:
        """Up to two hours without a sample."""
        self.now_us += program.u16() * 110_000
        self._step(1)

    def _measure(self, program: Program) -> None:
        i_x, i_y, t_x, t_y, v, force = (program.u8() for _ in range(6))
        self._readings = Readings(
            i_A=(i_x / 50, i_y / 50),
            v_V=(v / 20, v / 20),
            rtd_degC=(t_x - 50.0, t_y - 50.0, 20.0, 20.1),
            displacement_m=force * 1e-4,
            force_N=force - 20.0,
            supply_V=v / 10,
        )
        self._step(1)

    # The line

    def _request(self, message: m.Message) -> None:
        self._seq = (self._seq + 1) & 0xFF
        self._send(CODEC.frame(message, self._seq, self.board.session.session))

    def _send(self, data: bytes) -> None:
        for frame in self._heard.feed(data):
            if frame.type == m.ArmConfirm.info.number and len(frame.payload) == 5:
                self._confirmed.add(int.from_bytes(frame.payload[1:], "little"))
        self.deliver(data)
        self._check()

    def _step(self, samples: int) -> None:
        for _ in range(samples):
            self.now_us += _PERIOD_US
            state = self.sample()
            if state is not None:
                require(
                    state.mode is BoardState.ARMED or state.i_applied_mA == (0, 0),
                    "{} mA applied in {}",
                    state.i_applied_mA,
                    state.mode.name,
                )
            self._check()

    def _check(self) -> None:
        board = self.board
        now = board.state
        if now is BoardState.ARMED and self._was not in _HOT:
            require(
                self._token is not None and self._token in self._confirmed,
                "armed without the token that was granted",
            )
            self._confirmed.clear()
        self._was = now
        gate = board.outputs.gate
        require(not gate or now in _HOT, "the gate is on in {}", now.name)
        out = board.session.data_to_send()
        require(len(out) <= MOST_OUTPUT_BYTES, "{} bytes wait to be sent", len(out))
        for frame in self._said.feed(out):
            message = CODEC.unpack(frame.type, frame.payload)
            if isinstance(message, m.ArmToken):
                self._token = message.token

    def _check_parameters(self) -> None:
        for row in PARAMETERS:
            value = self.board.parameters.values[0, row.number]
            require(
                row.minimum <= value <= row.maximum,
                "{} = {} is out of its range",
                row.name,
                value,
            )
