"""Bytes to frames and back: `COBS( type u8 | seq u8 | session u16 | payload | crc32 u32 ) 0x00`.

Two rules:

1. The delimiter is never data, so one damaged frame costs one frame.
2. Whatever bytes arrive, the decoder yields frames or counts an error. It never raises, and it
   gives the same frames and the same counts however the bytes were cut up on the way.

The second rule is why a frame is judged only when its delimiter has arrived, with one exception:
a run of bytes too long to be a frame is counted (once) and dropped as soon as it is too long, so
that a line stuck at a level cannot fill the memory.
"""

from __future__ import annotations

import struct
from typing import NamedTuple
from zlib import crc32

import msgspec

MAX_DECODED = 128
"""Longest frame before COBS, in bytes: header, payload and CRC."""

HEADER = struct.Struct("<BBH")
CRC = struct.Struct("<I")
OVERHEAD = HEADER.size + CRC.size
MAX_PAYLOAD = MAX_DECODED - OVERHEAD
MAX_ENCODED = MAX_DECODED + 1
"""Longest frame on the wire without its delimiter. COBS adds one byte below 255."""

DELIMITER = b"\x00"


class Frame(NamedTuple):
    """One frame whose CRC was right."""

    type: int
    seq: int
    session: int
    payload: bytes


class DecoderStats(msgspec.Struct):
    """What a decoder has seen since it was made."""

    frames: int = 0
    length_errors: int = 0
    cobs_errors: int = 0
    crc_errors: int = 0
    dropped_bytes: int = 0

    @property
    def errors(self) -> int:
        """All frames lost, of whatever kind."""
        return self.length_errors + self.cobs_errors + self.crc_errors


def cobs_encode(data: bytes) -> bytes:
    """Return `data` (at most 253 bytes) without zero bytes, one byte longer."""
    encoded = bytearray(1)
    encoded += data
    start = 0
    end = encoded.find(0, 1)
    while end >= 0:
        encoded[start] = end - start
        start = end
        end = encoded.find(0, end + 1)
    encoded[start] = len(encoded) - start
    return bytes(encoded)


def cobs_decode(encoded: bytes) -> bytes | None:
    """Return the data of a zero-free COBS block of at most 254 bytes, None if it is none."""
    data = bytearray(encoded)
    size = len(data)
    position = 0
    while position < size:
        step = data[position]
        data[position] = 0
        position += step
    if position != size:
        return None
    return bytes(data[1:])


def encode_frame(type_: int, seq: int, session: int, payload: bytes) -> bytes:
    """Return the frame as it goes on the wire, delimiter included.

    Raises ValueError if the payload is longer than `MAX_PAYLOAD`.
    """
    if len(payload) > MAX_PAYLOAD:
        raise ValueError(
            f"payload of {len(payload)} bytes is over the limit of {MAX_PAYLOAD}; "
            "split the message in two"
        )
    body = HEADER.pack(type_, seq, session) + payload
    return cobs_encode(body + CRC.pack(crc32(body))) + DELIMITER


class FrameDecoder:
    """Collects bytes and returns the frames that are complete."""

    def __init__(self) -> None:
        self.stats = DecoderStats()
        self._partial = b""
        self._too_long = False

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames completed by `data`, oldest first. Never raises."""
        frames: list[Frame] = []
        chunks = data.split(DELIMITER)
        last = len(chunks) - 1
        for index, chunk in enumerate(chunks):
            if index == 0:
                chunk = self._partial + chunk  # noqa: PLW2901
            if index == last:
                self._keep(chunk)
            elif self._too_long:
                self.stats.dropped_bytes += len(chunk)
                self._too_long = False
            elif chunk:
                frame = self._decode(chunk)
                if frame is not None:
                    frames.append(frame)
        return frames

    def reset(self) -> None:
        """Forget a frame begun, as after the port was closed. The counters stay."""
        self.stats.dropped_bytes += len(self._partial)
        self._partial = b""
        self._too_long = False

    def _keep(self, chunk: bytes) -> None:
        if not self._too_long and len(chunk) > MAX_ENCODED:
            self._too_long = True
            self.stats.length_errors += 1
        if self._too_long:
            self.stats.dropped_bytes += len(chunk)
            chunk = b""
        self._partial = chunk

    def _decode(self, chunk: bytes) -> Frame | None:
        stats = self.stats
        size = len(chunk)
        if size <= OVERHEAD or size > MAX_ENCODED:
            stats.length_errors += 1
        else:
            data = cobs_decode(chunk)
            if data is None:
                stats.cobs_errors += 1
            elif crc32(data[:-4]) != CRC.unpack_from(data, size - 5)[0]:
                stats.crc_errors += 1
            else:
                stats.frames += 1
                type_, seq, session = HEADER.unpack_from(data)
                return Frame(type_, seq, session, data[4:-4])
        stats.dropped_bytes += size
        return None
