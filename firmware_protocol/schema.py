"""What a table of messages looks like as data, and how two of them differ.

Two ends agree when the CRC-32 of their descriptions agree. The description holds what changes the
meaning of a byte (numbers, names, kinds, counts, units, enumerations, parameters) and leaves out
prose, so that a better sentence does not lock anybody out.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec

from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.errors import SchemaError
from firmware_protocol.messages import PROTOCOL_MAJOR, PROTOCOL_MINOR, Message
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.wire import Field, fields_of

MAX_DESCRIPTION = 1 << 20
"""A description that inflates to more bytes than this is refused."""


def wire_name(cls: type[msgspec.Struct]) -> str:
    """Return the name used in documents and C: `ArmRequest` → `ARM_REQUEST`."""
    return re.sub("(?<!^)(?=[A-Z])", "_", cls.__name__).upper()


def describe(codec: Codec = CODEC) -> dict[str, Any]:
    """Return the description of a table as plain data."""
    enums: dict[str, dict[str, int]] = {}
    for cls in codec.messages:
        for field in fields_of(cls):
            for kind in (field.enum, field.wire.bits):
                if kind is not None:
                    enums[kind.__name__] = {str(member.name): member.value for member in kind}
    return {
        "version": [PROTOCOL_MAJOR, PROTOCOL_MINOR],
        "messages": [_message(cls) for cls in codec.messages],
        "enums": dict(sorted(enums.items())),
        "parameters": [[p.number, p.name, p.unit] for p in PARAMETERS],
    }


def _message(cls: type[Message]) -> dict[str, Any]:
    return {
        "name": wire_name(cls),
        "number": cls.info.number,
        "fields": [_described_field(field) for field in fields_of(cls)],
    }


def _described_field(field: Field) -> dict[str, Any]:
    described: dict[str, Any] = {"name": field.name, "kind": field.wire.kind}
    if field.wire.count != 1:
        described["count"] = field.wire.count
    if field.wire.unit:
        described["unit"] = field.wire.unit
    if field.wire.invalid is not None:
        described["invalid"] = field.wire.invalid
    if field.enum is not None:
        described["enum"] = field.enum.__name__
    if field.wire.bits is not None:
        described["bits"] = field.wire.bits.__name__
    if field.record is not None:
        described["record"] = wire_name(field.record)
    return described


def canonical_json(description: dict[str, Any]) -> bytes:
    """Return the one spelling of a description that its CRC is taken of."""
    return msgspec.json.encode(description, order="sorted")


def schema_crc(description: dict[str, Any]) -> int:
    """Return the number that both ends compare."""
    return zlib.crc32(canonical_json(description))


@cache
def own_crc() -> int:
    """Return the CRC of this version's table."""
    return schema_crc(describe())


def compress(description: dict[str, Any]) -> bytes:
    """Return the description as DESCRIBE sends it."""
    return zlib.compress(canonical_json(description), 9)


def decompress(blob: bytes) -> dict[str, Any]:
    """Return the description sent by a board. Raises SchemaError if it cannot be read."""
    inflater = zlib.decompressobj()
    try:
        text = inflater.decompress(blob, MAX_DESCRIPTION)
        description = msgspec.json.decode(text)
    except (zlib.error, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SchemaError(f"the board's description cannot be read: {error}") from None
    if not isinstance(description, dict):
        raise SchemaError("the board's description is no table of messages")
    return description


def differences(host: dict[str, Any], other: dict[str, Any]) -> tuple[str, ...]:
    """Return what differs, one line each: `STATE.tick: host has …, board has …`.

    A message or enumeration that one side lacks altogether is one line. Raises SchemaError if a
    description is not made as `describe` makes it.
    """
    try:
        of_host, of_board = _grouped(host), _grouped(other)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SchemaError(f"the board's description is damaged: {error!r}") from None
    lines: list[str] = []
    for group in sorted(of_host.keys() | of_board.keys()):
        if group in of_host and group in of_board:
            lines += _differences(group, of_host[group], of_board[group])
        else:
            lines.append(f"{group}: only the {'host' if group in of_host else 'board'} has it")
    return tuple(lines)


def _differences(group: str, of_host: dict[str, str], of_board: dict[str, str]) -> Iterator[str]:
    for key in sorted(of_host.keys() | of_board.keys()):
        host_value, other = of_host.get(key, "none"), of_board.get(key, "none")
        if host_value != other:
            yield f"{group}{'.' if key else ''}{key}: host has {host_value}, board has {other}"


def _grouped(description: dict[str, Any]) -> dict[str, dict[str, str]]:
    """Return message, enumeration or "parameters" → member → what it is, in words."""
    groups: dict[str, dict[str, str]] = {}
    for message in description.get("messages", ()):
        fields = {"": f"number 0x{message['number']:02x}"}
        for place, field in enumerate(message["fields"]):
            words = [f"{key} {field[key]}" for key in sorted(field) if key != "name"]
            fields[str(field["name"])] = f"#{place} {', '.join(words)}"
        groups[str(message["name"])] = fields
    for name, members in description.get("enums", {}).items():
        groups[str(name)] = {str(member): str(code) for member, code in members.items()}
    groups["parameters"] = {
        str(name): f"number {number}, unit {unit or 'none'}"
        for number, name, unit in description.get("parameters", ())
    }
    return groups
