"""Frames: COBS against an independent implementation, damage counted, never an exception."""

import random
from zlib import crc32

from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol.framing import (
    MAX_ENCODED,
    MAX_PAYLOAD,
    DecoderStats,
    Frame,
    FrameDecoder,
    cobs_decode,
    cobs_encode,
    encode_frame,
)

quiet = settings(derandomize=True, deadline=None, max_examples=300)


def decode(data: bytes) -> tuple[list[Frame], DecoderStats]:
    decoder = FrameDecoder()
    return decoder.feed(data), decoder.stats


def test_a_known_frame_has_the_bytes_that_the_document_shows() -> None:
    # DISARM of axis 0, sequence number 7, session 0x1234, put together by hand.
    body = bytes([0x13, 7, 0x34, 0x12, 0])
    crc = crc32(body).to_bytes(4, "little")
    assert 0 not in crc
    assert encode_frame(0x13, 7, 0x1234, b"\0") == (b"\x05" + body[:4] + b"\x05" + crc + b"\0")


@quiet
@given(st.binary(max_size=128))
def test_cobs_agrees_with_an_independent_implementation(data: bytes) -> None:
    assert cobs_encode(data) == cobs.encode(data)
    assert cobs_decode(cobs.encode(data)) == data


@quiet
@given(st.binary(min_size=1, max_size=MAX_ENCODED).filter(lambda data: 0 not in data))
def test_cobs_refuses_what_the_independent_implementation_refuses(data: bytes) -> None:
    try:
        expected = cobs.decode(data)
    except cobs.DecodeError:
        expected = None
    assert cobs_decode(data) == expected


@quiet
@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 65535), st.binary(max_size=120))
def test_a_frame_comes_back_as_it_was(type_: int, seq: int, session: int, payload: bytes) -> None:
    frames, stats = decode(encode_frame(type_, seq, session, payload))
    assert frames == [Frame(type_, seq, session, payload)]
    assert (stats.frames, stats.errors, stats.dropped_bytes) == (1, 0, 0)


def test_a_frame_cut_anywhere_is_decoded_once_whole() -> None:
    data = encode_frame(1, 2, 3, bytes(range(40)))
    for cut in range(len(data) + 1):
        decoder = FrameDecoder()
        frames = decoder.feed(data[:cut]) + decoder.feed(data[cut:])
        assert len(frames) == 1
        assert decoder.stats.errors == 0


@quiet
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=300),
            st.builds(
                encode_frame, st.integers(0, 255), st.just(1), st.just(2), st.binary(max_size=120)
            ),
        ),
        max_size=8,
    ),
    st.randoms(use_true_random=False),
)
def test_frames_and_counts_do_not_depend_on_how_bytes_are_cut(
    parts: list[bytes], rng: random.Random
) -> None:
    data = b"".join(parts)
    whole = FrameDecoder()
    expected = whole.feed(data)
    by_byte = FrameDecoder()
    found = [frame for byte in data for frame in by_byte.feed(bytes([byte]))]
    assert (found, by_byte.stats) == (expected, whole.stats)
    by_chunk = FrameDecoder()
    found = []
    while data:
        size = rng.randint(1, 200)
        found += by_chunk.feed(data[:size])
        data = data[size:]
    assert (found, by_chunk.stats) == (expected, whole.stats)


@quiet
@given(st.binary(max_size=2000))
def test_any_bytes_are_frames_or_counted_and_every_byte_is_accounted_for(data: bytes) -> None:
    decoder = FrameDecoder()
    frames = decoder.feed(data)
    stats = decoder.stats
    assert stats.frames == len(frames)
    decoder.feed(b"\0")
    in_frames = sum(len(cobs_encode(bytes(8) + frame.payload)) for frame in frames)
    assert stats.dropped_bytes + in_frames == len(data) - data.count(0)


def test_a_megabyte_without_a_delimiter_costs_one_length_error_and_no_memory() -> None:
    decoder = FrameDecoder()
    for _ in range(1024):
        assert decoder.feed(b"U" * 1024) == []
    assert decoder.stats.length_errors == 1
    assert decoder.stats.dropped_bytes == 1024 * 1024
    assert len(decoder.feed(b"\0" + encode_frame(1, 0, 0, b""))) == 1


def test_the_longest_frame_is_taken_and_one_byte_more_is_a_length_error() -> None:
    longest = encode_frame(1, 2, 3, b"\x01" * MAX_PAYLOAD)
    assert len(longest) == MAX_ENCODED + 1
    assert len(decode(longest)[0]) == 1
    frames, stats = decode(b"\x01" + longest)
    assert (frames, stats.length_errors) == ([], 1)
    assert decode(b"\x01" * MAX_ENCODED)[1].length_errors == 0
    assert decode(b"\x01" * (MAX_ENCODED + 1))[1].length_errors == 1


def test_every_single_flipped_bit_costs_at_most_that_frame_and_is_counted() -> None:
    frame = encode_frame(0x90, 5, 77, bytes(range(52)))
    after = encode_frame(0x13, 6, 77, b"\0")
    for bit in range(8 * (len(frame) - 1)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        frames, stats = decode(bytes(damaged) + after)
        assert frames == [Frame(0x13, 6, 77, b"\0")]
        assert stats.errors >= 1


def test_delimiters_alone_are_no_errors() -> None:
    frames, stats = decode(b"\0" * 50)
    assert (frames, stats.errors, stats.dropped_bytes) == ([], 0, 0)


def test_modem_probe_text_costs_one_error_and_the_next_frame_arrives() -> None:
    frames, stats = decode(b"AT\r\nATE1 E0 V1\r\nAT+GCAP\r\n\0" + encode_frame(1, 0, 0, b"x"))
    assert len(frames) == 1
    assert stats.errors == 1


def test_after_reset_a_frame_begun_before_is_forgotten() -> None:
    data = encode_frame(1, 2, 3, b"abc")
    decoder = FrameDecoder()
    decoder.feed(data[:5])
    decoder.reset()
    assert len(decoder.feed(data)) == 1
    assert decoder.stats.errors == 0
    assert decoder.stats.dropped_bytes == 5
