"""The store of the firmware as a file: what firmware/core/params.c keeps there.

A parameter image is what docs/protocol.md says: entries, then their CRC-32.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from firmware_protocol.parameters import ParameterStore

SIZE = 1024
ERASED = 0xFF
MARK = 0x5A
SLOTS = (16, 16 + (SIZE - 16) // 2)
_HEADER = struct.Struct("<IH")
_CRC = struct.Struct("<I")


def initial_image(rate_hz: int) -> bytes | None:
    """Return the image of a store that only sets the rate; None for the initial one."""
    parameters = ParameterStore(1)
    if parameters.get("state_rate_hz") == rate_hz:
        return None
    parameters.set(0, 1, rate_hz)
    return parameters.image()


def write_image(path: Path, image: bytes) -> None:
    """Put an image into the first slot, alone. One with a wrong CRC stays wrong in the slot."""
    packed, crc = image[: -_CRC.size], image[-_CRC.size :]
    damaged = crc != _CRC.pack(zlib.crc32(packed))
    body = _HEADER.pack(1, len(packed)) + packed
    slot = bytes([MARK]) + body + _CRC.pack(zlib.crc32(body) ^ int(damaged))
    content = bytearray(path.read_bytes() if path.exists() else b"").ljust(SIZE, bytes([ERASED]))
    content[SLOTS[0] :] = bytes([ERASED]) * (SIZE - SLOTS[0])
    content[SLOTS[0] : SLOTS[0] + len(slot)] = slot
    path.write_bytes(content)


def read_parameters(path: Path) -> ParameterStore:
    """Return the parameters as the newest good slot has them."""
    content = (path.read_bytes() if path.exists() else b"").ljust(SIZE, bytes([ERASED]))
    parameters = ParameterStore(1)
    best = 0
    for slot in SLOTS:
        sequence, size = _HEADER.unpack_from(content, slot + 1)
        body = content[slot + 1 : slot + 1 + _HEADER.size + size]
        end = slot + 1 + len(body)
        good = content[slot] != ERASED and content[end : end + 4] == _CRC.pack(zlib.crc32(body))
        if good and sequence > best:
            best = sequence
            packed = body[_HEADER.size :]
            parameters = ParameterStore(1)
            parameters.load(packed + _CRC.pack(zlib.crc32(packed)))
    return parameters
