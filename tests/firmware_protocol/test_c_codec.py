"""The generated C against the Python it was made from, on golden vectors and at random."""

import json
import random
from collections.abc import Iterator
from typing import Any

import pytest

from firmware_protocol.codec import CODEC
from firmware_protocol.framing import FrameDecoder, encode_frame
from firmware_protocol.generate.outputs import PACKAGE
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.messages import MESSAGES, Estop, State
from firmware_protocol.wire import BLOCK_KINDS, fields_of
from tests.firmware_protocol.c_peer import COMPILER, CPeer, build

pytestmark = pytest.mark.skipif(COMPILER is None, reason="this machine has no C compiler")


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CPeer]:
    program = CPeer(build(tmp_path_factory.mktemp("c")))
    yield program
    assert program.close() == 0


def load(name: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads((PACKAGE / "vectors" / name).read_text())
    return rows


def values(message: Any) -> list[str]:
    """The single values of a message as the C program prints them."""
    words: list[str] = []
    for field in fields_of(type(message)):
        value = getattr(message, field.name)
        if field.record is not None:
            words += values(value)
        elif field.wire.kind in BLOCK_KINDS:
            block = value.encode() if isinstance(value, str) else value
            words.append(block.ljust(field.wire.count, b"\0").hex())
        else:
            words += [str(int(item)) for item in (value if field.is_array else (value,))]
    return words


def test_golden_messages_mean_the_same_in_c_and_in_python(peer: CPeer) -> None:
    rows = load("messages.json")
    assert {row["message"] for row in rows} == {cls.__name__ for cls in MESSAGES}
    for row in rows:
        frame = bytes.fromhex(row["frame"])
        message = CODEC.unpack(row["number"], bytes.fromhex(row["payload"]))
        assert CODEC.frame(message, row["seq"], row["session"]) == frame
        [words], counters = peer.feed(frame)
        assert words[:4] == [
            str(row["number"]),
            str(row["seq"]),
            str(row["session"]),
            row["payload"],
        ]
        assert words[4:-1] == values(message)
        assert words[-1] == f"repacked={row['frame']}"
        assert counters == [1, 0, 0, 0, 0]


def test_golden_streams_give_the_same_frames_and_counters_in_c_and_in_python(peer: CPeer) -> None:
    for row in load("streams.json"):
        data = bytes.fromhex(row["bytes"])
        decoder = FrameDecoder()
        frames = [[f.type, f.seq, f.session, f.payload.hex()] for f in decoder.feed(data)]
        assert frames == row["frames"], row["name"]
        counters = row["counters"]
        found, counted = peer.feed(data)
        assert [[*map(int, words[:3]), words[3]] for words in found] == frames, row["name"]
        assert counted == [
            counters[name]
            for name in ("frames", "length_errors", "cobs_errors", "crc_errors", "dropped_bytes")
        ], row["name"]


@pytest.mark.parametrize("seed", range(3))
def test_random_messages_go_from_python_to_c_and_back_unchanged(peer: CPeer, seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(10):
        sent = [random_message(cls, rng) for cls in MESSAGES]
        frames = [CODEC.frame(message, rng.randrange(256), 77) for message in sent]
        found, counters = peer.feed(b"".join(frames))
        assert counters == [len(sent), 0, 0, 0, 0]
        for words, message, frame in zip(found, sent, frames, strict=True):
            assert words[4:-1] == values(message)
            repacked = bytes.fromhex(words[-1].removeprefix("repacked="))
            assert repacked == frame
            [back] = FrameDecoder().feed(repacked)
            assert CODEC.unpack(back.type, back.payload) == message


def test_damaged_streams_give_the_same_frames_and_counters_in_c_and_in_python(peer: CPeer) -> None:
    rng = random.Random(8)
    for _ in range(150):
        data = bytearray()
        for _ in range(rng.randrange(1, 6)):
            cls = rng.choice(MESSAGES)
            data += CODEC.frame(random_message(cls, rng), rng.randrange(256), 1)
        for _ in range(rng.randrange(6)):
            at = rng.randrange(len(data))
            kind = rng.randrange(4)
            if kind == 0:
                data[at] ^= 1 << rng.randrange(8)
            elif kind == 1:
                del data[at]
            elif kind == 2:
                data[at:at] = rng.randbytes(rng.randrange(1, 200))
            else:
                data[at] = 0
            data = data or bytearray(1)
        decoder = FrameDecoder()
        expected = decoder.feed(bytes(data))
        stats = decoder.stats
        found, counters = peer.feed(bytes(data))
        assert [words[3] for words in found] == [frame.payload.hex() for frame in expected]
        assert counters == [
            stats.frames,
            stats.length_errors,
            stats.cobs_errors,
            stats.crc_errors,
            stats.dropped_bytes,
        ]


def test_a_code_that_is_unknown_or_a_length_that_is_wrong_is_bad_in_c_too(peer: CPeer) -> None:
    payload = bytearray(CODEC.pack(random_message(State, random.Random(1))))
    payload[7] = 99
    for bad in (bytes(payload), bytes(payload[:-1]), b""):
        [words], _ = peer.feed(encode_frame(State.info.number, 1, 1, bad))
        assert words[-1] == "bad"
    [words], _ = peer.feed(encode_frame(0x7E, 1, 1, b"abc"))
    assert words[-1] == "unknown"
    [words], _ = peer.feed(CODEC.frame(Estop(), 0, 0))
    assert words[-1].startswith("repacked=")
