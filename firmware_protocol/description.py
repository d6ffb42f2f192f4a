"""Reading a board whose table of messages is not ours: fetch its description, decode what we know.

DESCRIBE and DESCRIPTION are frozen, so any host can fetch the description. From it `ForeignCodec`
decodes the board's messages by the names of their fields, whatever their order and kinds. A field
that the board does not send takes its "no reading" value or zero; one that we do not know is
skipped.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.errors import PayloadError, SchemaError
from firmware_protocol.framing import MAX_PAYLOAD, Frame
from firmware_protocol.messages import Describe, Description, Message
from firmware_protocol.schema import decompress, differences, wire_name
from firmware_protocol.stats import HostLinkStats
from firmware_protocol.wire import (
    BLOCK_KINDS,
    NUMBER_CODES,
    RECORD_KIND,
    Direction,
    Field,
    fields_of,
    has_unknown,
)

MAX_COMPRESSED = 1 << 16


class Download:
    """Collects the slices of a description in order."""

    def __init__(self) -> None:
        self._blob = b""

    def next_request(self) -> Describe:
        """Return the request for the next slice."""
        return Describe(offset=len(self._blob))

    def add(self, piece: Description) -> dict[str, Any] | None:
        """Take in a slice; return the description once it is whole.

        Raises SchemaError if the slices do not fit together or cannot be read.
        """
        data = piece.data[: piece.size]
        if piece.offset != len(self._blob) or not data or piece.total > MAX_COMPRESSED:
            raise SchemaError(
                f"the board's description breaks off at byte {len(self._blob)} of {piece.total}"
            )
        self._blob += data
        if len(self._blob) < piece.total:
            return None
        return decompress(self._blob[: piece.total])


class Reader:
    """How the host reads its board: by its own table, or by the board's once that is known."""

    def __init__(self, host_codec: Codec, host_description: dict[str, Any]) -> None:
        self.codec: Codec | ForeignCodec = host_codec
        self.understood = True
        self._host_codec = host_codec
        self._host_description = host_description
        self._download: Download | None = None

    def read(self, frame: Frame, stats: HostLinkStats) -> Message | None:
        """Return the message of a frame; None, counted, if it cannot be told what it means."""
        if not self.codec.knows(frame.type):
            stats.unknown_types += 1
            return None
        if not self.understood and not self._host_codec.layouts[frame.type].cls.info.frozen:
            stats.not_understood += 1
            return None
        try:
            return self.codec.unpack(frame.type, frame.payload)
        except PayloadError:
            stats.payload_errors += 1
            return None

    def begin_download(self) -> Describe:
        """Note that the board's table differs; return the first request for its description."""
        self.understood = False
        self._download = Download()
        return self._download.next_request()

    def next_request(self) -> Describe | None:
        """Return the request for what is still missing."""
        return None if self._download is None else self._download.next_request()

    def add(self, piece: Description) -> tuple[str, ...] | None:
        """Take in a slice. Once it is the last: return what differs, one line each."""
        if self._download is None:
            return None
        try:
            description = self._download.add(piece)
            if description is None:
                return None
            self.codec = ForeignCodec(description, self._host_codec)
            self.understood = True
            lines = differences(self._host_description, description)
        except SchemaError as error:
            lines = (str(error),)
        self._download = None
        return lines or ("the tables are equal, but not their CRCs; the board's is wrong",)


class ForeignCodec:
    """Decodes another table's messages into ours, as far as the names go."""

    def __init__(self, description: dict[str, Any], host_codec: Codec = CODEC) -> None:
        self._records: dict[str, list[dict[str, Any]]] = {}
        self._unpackers: dict[int, Callable[[bytes], Message]] = {}
        try:
            for message in description["messages"]:
                self._records[message["name"]] = message["fields"]
            numbers = {message["name"]: message["number"] for message in description["messages"]}
            for cls in host_codec.messages:
                name = wire_name(cls)
                # Whatever number it claims, a message to the board is none that a host hears.
                heard = cls.info.direction is Direction.TO_HOST and not cls.info.frozen
                if heard and name in numbers:
                    self._unpackers[numbers[name]] = self._unpacker(cls, name)
            # Last, for no other table can take the numbers of these.
            for cls in host_codec.messages:
                if cls.info.frozen:
                    self._unpackers[cls.info.number] = host_codec.layouts[cls.info.number].unpack
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            raise SchemaError(f"the board's description is damaged: {error!r}") from None

    def unpack(self, number: int, payload: bytes) -> Message:
        """Return the message. Raises PayloadError."""
        unpacker = self._unpackers.get(number)
        if unpacker is None:
            raise PayloadError(f"no message has the number 0x{number:02x}")
        try:
            return unpacker(payload)
        except (struct.error, KeyError, ValueError, TypeError) as error:
            raise PayloadError(f"message 0x{number:02x}: {error}") from None

    def knows(self, number: int) -> bool:
        """Whether messages of this number can be decoded."""
        return number in self._unpackers

    def _unpacker(self, cls: type[Message], name: str) -> Callable[[bytes], Message]:
        codes: list[str] = []
        places = self._places(name, codes, [0], depth=0)
        compiled = struct.Struct("<" + "".join(codes))
        if compiled.size > MAX_PAYLOAD:
            raise ValueError(f"{name} takes {compiled.size} bytes, the limit is {MAX_PAYLOAD}")
        return lambda payload: _build(cls, places, compiled.unpack(payload))

    def _places(
        self, name: str, codes: list[str], index: list[int], *, depth: int
    ) -> dict[str, Any]:
        """Return field name → (first value, count) or, for a record, the same inside."""
        if depth > 4:
            raise ValueError(f"{name} holds records within records within records")
        places: dict[str, Any] = {}
        for field in self._records[name]:
            kind, count = field["kind"], int(field.get("count", 1))
            if kind == RECORD_KIND:
                places[field["name"]] = self._places(field["record"], codes, index, depth=depth + 1)
                continue
            if not 1 <= count <= MAX_PAYLOAD:
                raise ValueError(f"{name}.{field['name']} has {count} values")
            values = 1 if kind in BLOCK_KINDS else count
            codes.append(f"{count}s" if kind in BLOCK_KINDS else NUMBER_CODES[kind] * count)
            places[field["name"]] = (index[0], values)
            index[0] += values
        return places


def _build(cls: type[Any], places: dict[str, Any], values: tuple[Any, ...]) -> Any:
    arguments = {}
    for field in fields_of(cls):
        place = places.get(field.name)
        if field.record is not None:
            inner = place if isinstance(place, dict) else {}
            arguments[field.name] = _build(field.record, inner, values)
        elif isinstance(place, tuple):
            first, count = place
            arguments[field.name] = _value(field, values[first : first + count])
        else:
            arguments[field.name] = _value(field, ())
    return cls(**arguments)


def _value(field: Field, values: tuple[Any, ...]) -> Any:
    kind, count = field.wire.kind, field.wire.count
    if kind in BLOCK_KINDS:
        block = values[0] if values and isinstance(values[0], bytes) else b""
        return block if kind == "bytes" else block.rstrip(b"\0").decode("ascii", "replace")
    default = field.wire.invalid or 0
    numbers = [value for value in values if isinstance(value, int)][:count]
    numbers += [default] * (count - len(numbers))
    if field.enum is not None:
        known = numbers[0] in field.enum.__members__.values()
        return field.enum(0 if not known and has_unknown(field.enum) else numbers[0])
    return tuple(numbers) if field.is_array else numbers[0]
