"""Messages and payloads: every field of every message, and refusals that name the field."""

import random
from typing import Annotated, ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.enums import BoardState, ErrorCode, Fault, faults_in, warnings_in
from firmware_protocol.errors import PayloadError, SchemaError
from firmware_protocol.framing import MAX_PAYLOAD
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.wire import Direction, MessageInfo, Wire, fields_of

quiet = settings(derandomize=True, deadline=None, max_examples=200)


@pytest.mark.parametrize("cls", m.MESSAGES, ids=lambda cls: cls.__name__)
def test_every_message_comes_back_as_it_was(cls: type[m.Message]) -> None:
    rng = random.Random(1)
    for extreme in (0, 1, *[None] * 50):
        message = random_message(cls, rng, extreme)
        payload = CODEC.pack(message)
        assert len(payload) == CODEC.layout(cls).size == sum(f.size for f in fields_of(cls))
        assert CODEC.unpack(cls.info.number, payload) == message


def test_numbers_are_little_endian_and_in_the_order_of_the_table() -> None:
    setpoint = m.Setpoint(
        axis=1,
        t_ref_us=0x04030201,
        i_mA=(0x0605, 0x0807),
        pump_duty=(9, 10),
        flags=11,
        ttl_ms=0x0D0C,
        stage_um=-2,
    )
    assert CODEC.pack(setpoint).hex(" ") == (
        "01 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d fe ff ff ff"
    )


def test_every_message_fits_a_frame_and_state_is_about_sixty_bytes_on_the_wire() -> None:
    assert max(layout.size for layout in CODEC.layouts.values()) <= MAX_PAYLOAD
    sample = random_message(m.State, random.Random(2))
    assert 60 <= len(CODEC.frame(sample, 1, 1)) <= 70


@quiet
@given(st.integers(0, 255), st.binary(max_size=130))
def test_any_payload_is_a_message_or_a_payload_error(number: int, payload: bytes) -> None:
    try:
        found = type(CODEC.unpack(number, payload)).info.number
    except PayloadError:
        found = None
    layout = CODEC.layouts.get(number)
    if layout is None or layout.size != len(payload):
        assert found is None
    else:
        assert found in (number, None)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"i_mA": (70_000, 0)}, ["i_mA", "70000", "65535"]),
        ({"i_mA": (1, 2, 3)}, ["i_mA", "2 values"]),
        ({"ttl_ms": -1}, ["ttl_ms", "-1", "0"]),
        ({"t_ref_us": 1.5}, ["t_ref_us", "1.5", "whole"]),
        ({"stage_um": None}, ["stage_um", "None"]),
    ],
)
def test_a_value_that_does_not_fit_is_refused_by_field_value_and_limit(
    changes: dict[str, object], words: list[str]
) -> None:
    values: dict[str, object] = {
        "axis": 0,
        "t_ref_us": 0,
        "i_mA": (0, 0),
        "pump_duty": (0, 0),
        "flags": 0,
        "ttl_ms": 100,
    }
    with pytest.raises(PayloadError) as caught:
        CODEC.pack(m.Setpoint(**(values | changes)))  # type: ignore[arg-type]
    assert all(word in str(caught.value) for word in words)


def test_text_that_is_too_long_is_refused_not_cut() -> None:
    ident = random_message(m.Ident, random.Random(3))
    fields = {name: getattr(ident, name) for name in ident.__struct_fields__}
    with pytest.raises(PayloadError, match="24"):
        CODEC.pack(m.Ident(**(fields | {"firmware": "x" * 25})))


def test_an_unknown_state_of_the_board_is_a_payload_error() -> None:
    payload = bytearray(CODEC.pack(random_message(m.State, random.Random(4))))
    payload[7] = 200
    with pytest.raises(PayloadError, match="State"):
        CODEC.unpack(m.State.info.number, bytes(payload))


def test_an_unknown_error_code_is_read_as_unknown_so_that_the_refusal_is_not_lost() -> None:
    payload = bytearray(CODEC.pack(m.Error(1, 2, ErrorCode.TOO_HOT, 0, 5, 6)))
    payload[2] = 250
    error = CODEC.unpack(m.Error.info.number, bytes(payload))
    assert error == m.Error(1, 2, ErrorCode.UNKNOWN, 0, 5, 6)


def test_fault_and_warning_words_are_read_bit_by_bit() -> None:
    assert faults_in(0) == ()
    assert faults_in(1 << 5 | 1 << 22) == (Fault.OVER_TEMPERATURE, Fault.I2T)
    assert [warning.value for warning in warnings_in(0b101)] == [0, 2]
    assert max(Fault) <= 32


def _message(number: int, direction: Direction, hint: object, name: str = "Odd") -> type:
    return type(m.Message)(
        name,
        (m.Message,),
        {
            "__annotations__": {"info": ClassVar[MessageInfo], "value": hint},
            "info": MessageInfo(number=number, direction=direction, pace="never"),
            "__module__": __name__,
        },
        frozen=True,
    )


@pytest.mark.parametrize(
    ("number", "direction", "hint", "words"),
    [
        (0x90, Direction.TO_HOST, Annotated[int, Wire("u8")], "free number"),
        (0x70, Direction.TO_HOST, Annotated[int, Wire("u8")], "0x80"),
        (0x7F, Direction.TO_BOARD, int, "Wire"),
        (0x7F, Direction.TO_BOARD, Annotated[int, Wire("u24")], "u24"),
        (0x7F, Direction.TO_BOARD, Annotated[bytes, Wire("bytes", count=121)], "split"),
    ],
)
def test_a_table_that_contradicts_itself_is_refused(
    number: int, direction: Direction, hint: object, words: str
) -> None:
    with pytest.raises(SchemaError, match=words):
        Codec([m.State, _message(number, direction, hint)])


def test_board_states_have_the_numbers_of_the_protocol() -> None:
    names = ["BOOT", "SAFE", "ARMED", "HOLD", "COOL", "FAULT", "ESTOP"]
    assert [state.name for state in BoardState] == names
    assert [state.value for state in BoardState] == list(range(7))
