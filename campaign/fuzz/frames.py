"""The frame decoder: the same frames however the bytes were cut, and back to the same bytes."""

from __future__ import annotations

from campaign.fuzz.program import Program, require
from firmware_protocol.codec import CODEC
from firmware_protocol.errors import PayloadError
from firmware_protocol.framing import (
    MAX_ENCODED,
    MAX_PAYLOAD,
    Frame,
    FrameDecoder,
    cobs_decode,
    cobs_encode,
    encode_frame,
)


def run(data: bytes) -> None:
    """The first byte is the length of the pieces; the second makes one good frame of the rest."""
    program = Program(data)
    step, shape = program.u8() or 1, program.u8()
    stream = program.rest()
    if shape & 1:
        good = encode_frame(shape, step, len(stream), stream[: min(shape // 2, MAX_PAYLOAD)])
        stream = stream + b"\0" + good + stream
    whole = FrameDecoder()
    frames = whole.feed(stream)
    _same_however_cut(stream, frames, whole, step)
    require(len(frames) == whole.stats.frames, "a frame was not counted")
    pieces = [piece for piece in stream.split(b"\0")[:-1] if piece]
    require(
        whole.stats.frames + whole.stats.errors <= len(pieces) + 1,
        "more frames and errors than pieces between delimiters",
    )
    for frame in frames:
        _encodes_back(frame)
    for piece in pieces[:4]:
        plain = cobs_decode(piece[:254])
        if plain is not None and len(plain) <= 253:
            require(cobs_decode(cobs_encode(plain)) == plain, "COBS does not decode to itself")


def _same_however_cut(stream: bytes, frames: list[Frame], whole: FrameDecoder, step: int) -> None:
    for width in {1, step}:
        cut = FrameDecoder()
        decoded: list[Frame] = []
        for offset in range(0, len(stream), width):
            decoded += cut.feed(stream[offset : offset + width])
        require(decoded == frames, "other frames in pieces of {} bytes", width)
        # Bytes of a frame not yet ended may be held; that is all that may differ.
        require(cut.stats.frames == whole.stats.frames, "frames counted differently")
        require(cut.stats.errors == whole.stats.errors, "errors counted differently")
        cut.reset()
        require(cut.stats.dropped_bytes <= len(stream), "more bytes were dropped than there were")
        emptied = FrameDecoder()
        emptied.feed(stream)
        before = emptied.stats.dropped_bytes
        emptied.reset()
        require(emptied.stats.dropped_bytes - before <= MAX_ENCODED, "holds more than one frame")
        require(emptied.stats.dropped_bytes == cut.stats.dropped_bytes, "dropped bytes differ")


def _encodes_back(frame: Frame) -> None:
    again = FrameDecoder().feed(encode_frame(*frame))
    require(again == [frame], "a frame does not decode to itself")
    try:
        message = CODEC.unpack(frame.type, frame.payload)
    except PayloadError:
        return
    payload = CODEC.pack(message)
    require(CODEC.unpack(frame.type, payload) == message, "a message does not decode to itself")
