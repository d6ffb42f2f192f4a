"""Whatever the simulated board is told, it answers and goes on."""

import pytest

from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, ErrorCode, SetpointFlag
from firmware_protocol.events import BoardEvent, ErrorReceived
from firmware_protocol.supervisor import compiled_limits
from sim_device.bench import SimulatedBench
from sim_device.board import CAPABILITIES, Board
from sim_device.commands import STAGE_FIELD
from sim_device.faults import injection

from .loop import Answer, Loop

MOST = 2**31 - 1
TRAVEL_um = compiled_limits().stage_travel_um

every_fixture = pytest.mark.parametrize("fixture", CAPABILITIES)


def goes_on(loop: Loop) -> bool:
    """Whether the board still samples and answers."""
    before = len(loop.states)
    loop.step(5)
    return len(loop.states) == before + 5 and loop.request(wire.ParamGet(0, 1)) is not None


def stage_at(stage_um: int, flags: int = SetpointFlag.STAGE) -> Answer:
    return lambda state: wire.Setpoint(0, state.t_us, (0, 0), (0, 0), flags, 100, stage_um)


@pytest.mark.parametrize("token", [0, 1, 2**31 - 1, 2**31, 2**32 - 1])
def test_a_wrong_token_of_any_size_is_refused(token: int) -> None:
    loop = Loop(SimulatedBench(seed=2)).connected()
    assert isinstance(
        loop.request(wire.ArmRequest(0, loop.bench.board.parameters.crc)), wire.ArmToken
    )
    error = loop.request(wire.ArmConfirm(0, token))
    assert isinstance(error, wire.Error)
    assert (error.code, error.value) == (ErrorCode.TOKEN_WRONG, min(token, MOST))
    assert goes_on(loop)
    assert loop.mode is BoardState.SAFE


def test_of_two_who_arm_at_once_the_first_is_refused_with_his_token() -> None:
    for seed in range(8):
        loop = Loop(SimulatedBench(seed=seed)).connected()
        crc = loop.bench.board.parameters.crc
        first = loop.request(wire.ArmRequest(0, crc))
        second = loop.request(wire.ArmRequest(0, crc))
        assert isinstance(first, wire.ArmToken)
        assert isinstance(second, wire.ArmToken)
        error = loop.request(wire.ArmConfirm(0, first.token))
        assert isinstance(error, wire.Error)
        assert (error.code, error.value) == (ErrorCode.TOKEN_WRONG, min(first.token, MOST))
        assert goes_on(loop)


@every_fixture
@pytest.mark.parametrize(
    ("stage_um", "limit"),
    [(MOST, TRAVEL_um), (TRAVEL_um + 1, TRAVEL_um), (-1, 0), (-MOST - 1, 0)],
)
def test_a_stage_beyond_its_travel_is_refused_with_value_and_limit(
    fixture: str, stage_um: int, limit: int
) -> None:
    bench = SimulatedBench(fixture=fixture)
    loop = Loop(bench).armed()
    loop.answer = stage_at(stage_um)
    loop.step(2)
    assert bench.board.stage_m == 0.0
    error = loop.of(ErrorReceived)[-1].error  # type: ignore[attr-defined]
    assert error.code is ErrorCode.OUT_OF_RANGE
    assert (error.request_type, error.field) == (wire.Setpoint.info.number, STAGE_FIELD)
    assert (error.value, error.limit) == (stage_um, limit)
    # Refused whole: a host that asks for nothing else is one that does not answer.
    loop.until(lambda: loop.mode is BoardState.HOLD, 20)
    loop.answer = stage_at(TRAVEL_um)
    loop.until(lambda: loop.mode is BoardState.ARMED, 5)
    assert bench.board.stage_m == pytest.approx(TRAVEL_um * 1e-6)
    assert goes_on(loop)


@every_fixture
def test_a_stage_that_is_not_meant_may_say_anything(fixture: str) -> None:
    loop = Loop(SimulatedBench(fixture=fixture)).armed()
    loop.answer = stage_at(MOST, flags=0)
    loop.step(30)
    assert loop.mode is BoardState.ARMED
    assert loop.of(ErrorReceived) == []


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("supply_sag", {"volts": 1e6}),
        ("supply_sag", {"volts": -5.0}),
        ("encoder_slip", {"counts": 1e12}),
        ("sensor_offset", {"value": -1e9}),
    ],
)
def test_a_converter_stops_at_its_rails(name: str, values: dict[str, float]) -> None:
    loop = Loop(SimulatedBench(seed=1, faults=[injection(name, 1.0, **values)])).connected()
    loop.step(150)
    assert goes_on(loop)
    assert all(CODEC.unpack(wire.State.info.number, CODEC.pack(s)) == s for s in loop.states)


def test_the_board_acts_on_every_event_of_its_session() -> None:
    board = Board()
    assert set(board.commands._actions) == set(BoardEvent.__subclasses__())
