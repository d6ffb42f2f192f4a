"""Boards of another version: identified, watched where possible, never commanded."""

from typing import Annotated

import msgspec
import pytest

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.description import Download, ForeignCodec
from firmware_protocol.enums import BoardState, ErrorCode, Limiter
from firmware_protocol.errors import NotAllowedError, PayloadError, SchemaError
from firmware_protocol.events import HostState
from firmware_protocol.schema import (
    compress,
    decompress,
    describe,
    differences,
    own_crc,
    schema_crc,
)
from firmware_protocol.wire import Wire
from tests.firmware_protocol.pair import IDENT, SAMPLE, Pair, TestBoard, setpoint


class State(m.Message, frozen=True, gc=False):
    """STATE of a newer board: other order, other widths, a field more, several less."""

    info = m.State.info
    axis: Annotated[int, Wire("u8")]
    mode: Annotated[BoardState, Wire("u8")]
    tick: Annotated[int, Wire("u16")]
    humidity_permille: Annotated[int, Wire("u16", unit="permille")]
    t_us: Annotated[int, Wire("u32", unit="us")]
    rtd_cC: Annotated[tuple[int, int], Wire("i32", unit="cC", count=2)]
    valid: Annotated[int, Wire("u16")]
    sp_seq: Annotated[int, Wire("u8")]
    sp_age_us: Annotated[int, Wire("u16", unit="us")]


OTHER_STATE = State(
    axis=0,
    mode=BoardState.SAFE,
    tick=0,
    humidity_permille=412,
    t_us=0,
    rtd_cC=(2345, -678),
    valid=0,
    sp_seq=0,
    sp_age_us=0,
)
OTHER = Codec([State if cls is m.State else cls for cls in m.MESSAGES if cls is not m.FaultReport])


def other_pair() -> Pair:
    return Pair(board=TestBoard(codec=OTHER), sample=OTHER_STATE)


def test_another_major_version_is_identified_and_nothing_more() -> None:
    ident = msgspec.structs.replace(IDENT, major=2, minor=3, firmware="future 9")
    pair = Pair(board=TestBoard(ident=ident)).connect()
    [told] = pair.told(e.Incompatible)
    assert told.reason is e.IncompatibleReason.MAJOR
    assert "2.3" in told.fields[0]
    assert "future 9" in told.fields[0]
    assert pair.host.board is not None
    assert pair.host.board.uid == IDENT.uid
    assert pair.host.state is HostState.SYNC
    assert pair.board.session.session == 0
    pair.run(300)
    assert pair.told(e.StateReceived) == []


def test_a_board_reflashed_to_our_version_is_taken_up_when_it_boots() -> None:
    ident = msgspec.structs.replace(IDENT, major=2)
    pair = Pair(board=TestBoard(ident=ident)).connect()
    pair.reboot()
    pair.run(10)
    assert pair.host.state is HostState.MONITOR
    assert pair.host.incompatible is None


def test_another_schema_is_watched_and_the_fields_that_differ_are_named() -> None:
    pair = other_pair().connect().run(100)
    [told] = pair.told(e.Incompatible)
    assert told.reason is e.IncompatibleReason.SCHEMA
    text = "\n".join(told.fields)
    assert "STATE.humidity_permille: host has none, board has #3" in text
    assert "STATE.rtd_cC: host has #11 count 4" in text
    assert "FAULT_REPORT: only the host has it" in text
    assert not any(line.startswith("SETPOINT") for line in told.fields)
    assert pair.host.state is HostState.MONITOR


def test_samples_of_another_schema_are_read_by_the_names_of_their_fields() -> None:
    pair = other_pair().connect().run(100)
    states = [event.state for event in pair.told(e.StateReceived)]
    assert len(states) > 50
    state = states[-1]
    assert type(state) is m.State
    assert state.rtd_cC == (2345, -678, -32768, -32768)
    assert state.encoder_counts == -(2**31)
    assert state.vbus_mV == 0xFFFF
    assert state.limiter is Limiter.NONE
    assert state.tick == pair.board.tick
    assert pair.host.stats.not_understood > 0
    assert pair.host.stats.payload_errors == 0


def test_a_board_of_another_schema_is_sent_no_command_but_estop() -> None:
    pair = other_pair().connect().run(100)
    with pytest.raises(NotAllowedError, match="ArmRequest"):
        pair.host.request(m.ArmRequest(0, 0), pair.now_us)
    pair.host.send_setpoint(setpoint(pair.board.now()))
    pair.run(3)
    assert pair.host.stats.setpoints_sent == 0
    assert pair.host.stats.setpoints_dropped == 1
    pair.host.send_estop()
    pair.run(3)
    assert pair.board.mode is BoardState.ESTOP


def test_the_board_too_refuses_commands_from_a_host_of_another_schema() -> None:
    board = TestBoard(codec=OTHER)
    hello = m.Hello(m.PROTOCOL_MAJOR, 0, own_crc(), nonce=5)
    board.take(CODEC.frame(hello, 0, 0))
    session = board.session.session
    assert board.events == [e.SessionStarted(session, schema_agrees=False)]
    for message in (m.ArmRequest(0, 0), setpoint(0), m.ParamSet(0, 20, 1)):
        board.take(CODEC.frame(message, 1, session))
    assert len(board.events) == 1
    assert board.actions == {}
    assert board.session.parameters.get("current_limit_mA") != 1


def test_a_refused_command_of_another_schema_is_answered_with_the_reason() -> None:
    board = TestBoard(codec=OTHER)
    board.take(CODEC.frame(m.Hello(m.PROTOCOL_MAJOR, 0, own_crc(), nonce=5), 0, 0))
    board.session.data_to_send()
    board.take(CODEC.frame(m.Disarm(0), 9, board.session.session))
    sent = board.session.data_to_send()
    error = m.Error(m.Disarm.info.number, 9, ErrorCode.SCHEMA_DIFFERS, m.NO_FIELD, 0, 0)
    assert CODEC.frame(error, 9, board.session.session) in sent


def test_a_description_lost_in_parts_is_fetched_all_the_same() -> None:
    pair = other_pair()
    pair.up.drop = pair.down.drop = 0.004
    pair.connect().run(1500)
    assert pair.told(e.Incompatible)
    assert pair.told(e.Incompatible)[-1].fields
    assert pair.told(e.StateReceived)


def test_hello_and_what_it_takes_to_explain_a_difference_are_frozen() -> None:
    frozen = {cls.__name__ for cls in m.MESSAGES if cls.info.frozen}
    assert frozen == {"Hello", "Ident", "Error", "Estop", "Describe", "Description"}
    layouts = {
        cls.__name__: (cls.info.number, CODEC.layout(cls).format)
        for cls in m.MESSAGES
        if cls.info.frozen
    }
    # These never change: other versions in the field rely on them.
    assert layouts == {
        "Hello": (0x01, "<BBII"),
        "Describe": (0x02, "<H"),
        "Estop": (0x03, "<"),
        "Ident": (0x81, "<BBIIIHIBBBIHI12s24s"),
        "Description": (0x82, "<HHB96s"),
        "Error": (0x83, "<BBBBii"),
    }


def test_equal_tables_have_no_differences_and_prose_does_not_count() -> None:
    assert differences(describe(), describe()) == ()
    assert schema_crc(describe(Codec(m.MESSAGES))) == own_crc()


def test_a_description_survives_its_compression() -> None:
    assert decompress(compress(describe())) == msgspec.json.decode(msgspec.json.encode(describe()))


@pytest.mark.parametrize(
    "blob",
    [
        b"",
        b"not zlib",
        compress(describe())[:-40],
        compress({"messages": 5}),
        compress({"messages": [{"name": "STATE", "number": 1}]}),
        compress({"messages": [{"name": "STATE", "number": 1, "fields": [{"name": "a"}]}]}),
        compress({
            "messages": [{
                "name": "STATE",
                "number": 1,
                "fields": [{"name": "a", "kind": "record", "record": "STATE"}],
            }]
        }),
        compress({
            "messages": [{
                "name": "STATE",
                "number": 1,
                "fields": [{"name": "a", "kind": "u8", "count": 10**9}],
            }]
        }),
    ],
)  # fmt: skip
def test_a_damaged_description_is_a_schema_error(blob: bytes) -> None:
    with pytest.raises(SchemaError):
        ForeignCodec(decompress(blob))


def test_a_description_that_does_not_inflate_within_a_megabyte_is_refused() -> None:
    with pytest.raises(SchemaError):
        decompress(compress({"messages": "x" * (1 << 21)}))


def test_slices_that_do_not_join_are_refused() -> None:
    for piece in (
        m.Description(offset=5, total=100, size=10, data=bytes(96)),
        m.Description(offset=0, total=100, size=0, data=bytes(96)),
    ):
        with pytest.raises(SchemaError, match="byte 0 of 100"):
            Download().add(piece)


def test_a_payload_of_another_length_is_a_payload_error_of_the_foreign_codec_too() -> None:
    codec = ForeignCodec(describe())
    assert codec.unpack(m.State.info.number, CODEC.pack(SAMPLE)) == SAMPLE
    with pytest.raises(PayloadError):
        codec.unpack(m.State.info.number, b"short")
    with pytest.raises(PayloadError, match="0x77"):
        codec.unpack(0x77, b"")
