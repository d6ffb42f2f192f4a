"""Every message of the table is handled, every number of the wire taken, and every pause survived.

A message that a later table adds must not end a session before somebody has written its handler.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import pytest

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.enums import ErrorCode
from firmware_protocol.host import HostSession
from firmware_protocol.replies import error_of
from firmware_protocol.setpoints import SetpointGate
from firmware_protocol.wire import Direction, MessageInfo, Wire
from tests.firmware_protocol import c_gate
from tests.firmware_protocol.pair import Pair, TestBoard

WRAP = 1 << 32
MINUTE_US = 60_000_000
MOST_AGE_US = 50_000
I32 = (-(2**31), 2**31 - 1)

TO_HOST = [cls for cls in m.MESSAGES if cls.info.direction is Direction.TO_HOST]
TO_BOARD = [cls for cls in m.MESSAGES if cls.info.direction is Direction.TO_BOARD]


class Ping(m.Message, frozen=True, gc=False):
    """A request that no session has a handler for."""

    info = MessageInfo(number=0x70, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    word: Annotated[int, Wire("u32", "any")]


class Pong(m.Message, frozen=True, gc=False):
    """News that no session has a handler for."""

    info = MessageInfo(number=0xF0, direction=Direction.TO_HOST, pace="now and then")
    word: Annotated[int, Wire("u32", "any")]


LATER = Codec((*m.MESSAGES, Ping, Pong))


def payload(cls: type[m.Message]) -> bytes:
    """Zeros are a payload of every message: axis 0, and the first code of each enumeration."""
    return bytes(CODEC.layout(cls).size)


def hear(host: HostSession, frame: bytes, now_us: int) -> list[e.HostEvent]:
    return host.receive(b"\0" + frame, now_us)


def test_every_message_that_is_written_is_in_the_table() -> None:
    written = {cls for cls in vars(m).values() if isinstance(cls, type)}
    written = {cls for cls in written if issubclass(cls, m.Message) and cls is not m.Message}
    assert written == set(m.MESSAGES)


@pytest.mark.parametrize("cls", TO_HOST)
def test_the_host_has_a_handler_for_every_message_of_a_board(cls: type[m.Message]) -> None:
    pair = Pair().connect()
    message = CODEC.unpack(cls.info.number, payload(cls))
    hear(pair.host, CODEC.frame(message, 1, pair.host.session), pair.now_us)
    assert pair.host.stats.payload_errors == pair.host.stats.unhandled == 0


@pytest.mark.parametrize("cls", TO_BOARD)
def test_the_board_has_a_handler_for_every_message_of_a_host(cls: type[m.Message]) -> None:
    pair = Pair().connect()
    session = pair.board.session
    message = CODEC.unpack(cls.info.number, payload(cls))
    pair.board.take(b"\0" + CODEC.frame(message, 1, session.session))
    assert session.stats.payload_errors == session.stats.unhandled == 0


def test_a_message_that_the_host_has_no_handler_for_is_counted() -> None:
    pair = Pair(board=TestBoard(codec=LATER), codec=LATER).connect()
    before = pair.host.state
    assert hear(pair.host, LATER.frame(Pong(7), 1, pair.host.session), pair.now_us) == []
    assert pair.host.stats.unhandled == 1
    assert pair.run(5).host.state is before


def test_a_request_that_the_board_has_no_handler_for_is_refused_and_the_next_is_answered() -> None:
    pair = Pair(board=TestBoard(codec=LATER), codec=LATER).connect()
    failed = pair.ask(Ping(2**32 - 1))
    assert isinstance(failed, e.RequestFailed)
    assert failed.error is not None
    assert failed.error.code is ErrorCode.UNKNOWN_TYPE
    assert pair.board.session.stats.unhandled == 1
    assert isinstance(pair.ask(m.ParamGet(0, 1)), e.RequestDone)


@pytest.mark.parametrize("found", [0, -1, 2**31 - 1, 2**31, 2**32 - 1, -(2**31) - 1, 2**70])
def test_an_error_holds_any_number_as_far_as_the_wire_can(found: int) -> None:
    error = error_of(0x12, 3, ErrorCode.TOKEN_WRONG, m.NO_FIELD, value=found, limit=-found)
    nearest = min(max(found, I32[0]), I32[1])
    assert (error.value, error.limit) == (nearest, min(max(-found, I32[0]), I32[1]))
    assert CODEC.unpack(m.Error.info.number, CODEC.pack(error)) == error


# The door for setpoints: in Python, and in the C that a firmware uses.


@pytest.fixture(scope="module")
def c_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if c_gate.COMPILER is None:
        pytest.skip("this machine has no C compiler")
    return c_gate.build(tmp_path_factory.mktemp("gate"))


@pytest.fixture(params=["python", "c"])
def gate(request: pytest.FixtureRequest) -> Iterator[c_gate.Gate]:
    if request.param == "python":
        door = SetpointGate(MOST_AGE_US)
        yield lambda t_ref_us, seq, now_us: door.admit(0, t_ref_us % WRAP, seq, now_us)
        return
    program = c_gate.CGate(request.getfixturevalue("c_program"))
    yield program.admit
    assert program.close() == 0


@pytest.mark.parametrize("minutes", [0, 1, 35, 36, 40, 54, 71, 72, 73, 108, 143, 144, 1440])
def test_a_setpoint_passes_after_a_pause_of_any_length(gate: c_gate.Gate, minutes: int) -> None:
    start_us = 3 * WRAP - 7_000_000
    assert gate(start_us - 2000, 250, start_us) == 2000
    now_us = start_us + minutes * MINUTE_US + 10_000
    assert gate(now_us - 3000, 251, now_us) == 3000
    # What was overtaken still stays outside, and so does a second copy.
    assert gate(now_us - 4000, 252, now_us) is None
    assert gate(now_us - 3000, 251, now_us + 1) is None
    assert gate(now_us - 3000, 252, now_us + 2) == 3002


def test_a_pause_as_long_as_the_clock_takes_to_wrap_makes_nothing_a_copy(gate: c_gate.Gate) -> None:
    assert gate(5000, 9, 6000) == 1000
    assert gate(5000 + WRAP, 9, 6000 + WRAP) == 1000
    assert gate(4000 + 2 * WRAP, 9, 6000 + 2 * WRAP) == 2000


def test_old_setpoints_and_ones_from_the_future_stay_outside(gate: c_gate.Gate) -> None:
    now_us = WRAP + 20_000
    assert gate(now_us - MOST_AGE_US - 1, 1, now_us) is None
    assert gate(now_us + 1, 1, now_us) is None
    assert gate(now_us - MOST_AGE_US, 1, now_us) == MOST_AGE_US


def test_both_doors_decide_alike_on_random_setpoints(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    if c_gate.COMPILER is None:
        pytest.skip("this machine has no C compiler")
    program = c_gate.CGate(c_gate.build(tmp_path_factory.mktemp("gate")))
    door = SetpointGate(MOST_AGE_US)
    passed = 0
    for t_ref_us, seq, now_us in c_gate.random_setpoints(seed=4, count=20_000):
        said = door.admit(0, t_ref_us % WRAP, seq, now_us)
        assert program.admit(t_ref_us, seq, now_us) == said, (t_ref_us, seq, now_us)
        passed += said is not None
    assert 2000 < passed < 18_000
    assert program.close() == 0
