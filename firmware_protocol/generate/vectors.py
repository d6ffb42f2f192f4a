"""Golden vectors: messages with their bytes, and streams with what a decoder makes of them.

A firmware author can test a codec with them without Python. Each message comes three times: all
fields at their smallest, all at their largest, and a random one.
"""

from __future__ import annotations

import random
from typing import Any

import msgspec

from firmware_protocol import messages as m
from firmware_protocol.codec import Codec
from firmware_protocol.framing import MAX_PAYLOAD, FrameDecoder, encode_frame
from firmware_protocol.wire import Field, fields_of

SEED = 20
_TEXT = "smad firmware 0123456789"


def random_message(cls: type[Any], rng: random.Random, extreme: int | None = None) -> Any:
    """Return a message whose fields are random; smallest or largest for `extreme` 0 or 1."""
    return cls(**{field.name: _value(field, rng, extreme) for field in fields_of(cls)})


def _value(field: Field, rng: random.Random, extreme: int | None) -> Any:
    if field.record is not None:
        return random_message(field.record, rng, extreme)
    if field.wire.kind == "char":
        return _TEXT[
            : (0, field.wire.count)[extreme] if extreme is not None else rng.randint(1, 20)
        ]
    if field.wire.kind == "bytes":
        return bytes(rng.randrange(256) for _ in range(field.wire.count))
    if field.enum is not None:
        members = list(field.enum)
        return members[(0, -1)[extreme]] if extreme is not None else rng.choice(members)
    low, high = field.span
    values = tuple(
        (low, high)[extreme] if extreme is not None else rng.randint(low, high)
        for _ in range(field.wire.count)
    )
    return values if field.is_array else values[0]


def messages(codec: Codec) -> str:
    """Return messages.json: message, fields, header, payload and frame, bytes in hex."""
    rng = random.Random(SEED)
    rows = []
    for cls in codec.messages:
        for extreme in (0, 1, None):
            message = random_message(cls, rng, extreme)
            seq, session = rng.randrange(256), rng.randrange(65536)
            rows.append(
                {
                    "message": cls.__name__,
                    "number": cls.info.number,
                    "seq": seq,
                    "session": session,
                    "fields": plain(message),
                    "payload": codec.pack(message).hex(),
                    "frame": codec.frame(message, seq, session).hex(),
                }
            )
    return _lines(rows)


def plain(value: Any) -> Any:
    """Return a message as JSON has it: bytes in hex, enumerations as numbers."""
    if isinstance(value, msgspec.Struct):
        return {name: plain(getattr(value, name)) for name in value.__struct_fields__}
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    if isinstance(value, bytes):
        return value.hex()
    return value if isinstance(value, str) else int(value)


def streams(codec: Codec) -> str:
    """Return streams.json: bytes, the frames in them, and the decoder's counters."""
    rows = []
    for name, data in _streams(codec):
        decoder = FrameDecoder()
        frames = decoder.feed(data)
        rows.append(
            {
                "name": name,
                "bytes": data.hex(),
                "frames": [[f.type, f.seq, f.session, f.payload.hex()] for f in frames],
                "counters": msgspec.structs.asdict(decoder.stats),
            }
        )
    return _lines(rows)


def _streams(codec: Codec) -> list[tuple[str, bytes]]:
    rng = random.Random(SEED)
    good = codec.frame(m.Disarm(axis=0), 7, 0x1234)
    state = codec.frame(random_message(m.State, rng), 8, 0x1234)
    flipped = bytearray(state)
    flipped[20] ^= 0x10
    broken = bytearray(good)
    broken[0] = 0xF0
    return [
        ("one frame", good),
        ("delimiters alone", b"\0\0\0"),
        ("noise, a delimiter, a frame", b"AT+GCAP\r\n\0" + good),
        ("a flipped bit, then a frame", bytes(flipped) + good),
        ("a wrong distance, then a frame", bytes(broken) + good),
        ("a frame cut short by the next", state[:30] + b"\0" + good),
        ("a frame without its end", good + state[:-1]),
        ("the longest frame", encode_frame(0x90, 1, 2, bytes(range(MAX_PAYLOAD)))),
        ("all zero payload", encode_frame(0x90, 1, 2, bytes(MAX_PAYLOAD))),
        ("one byte too long", b"\x01" * 130 + b"\0" + good),
        ("much too long", b"U" * 1000 + b"\0" + good),
        ("too short", b"\x02\x01\0" + good),
        ("an empty payload", encode_frame(0x03, 0, 0, b"")),
        ("two frames and half a third", good + state + good[:5]),
    ]


def _lines(rows: list[dict[str, Any]]) -> str:
    return "[\n" + ",\n".join(msgspec.json.encode(row).decode() for row in rows) + "\n]\n"
