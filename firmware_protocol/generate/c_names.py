"""How things of the tables are called in C."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from firmware_protocol.codec import Codec
from firmware_protocol.messages import Message
from firmware_protocol.schema import wire_name
from firmware_protocol.wire import BLOCK_KINDS, Field, fields_of, has_unknown

TYPES = {
    "u8": "uint8_t",
    "u16": "uint16_t",
    "i16": "int16_t",
    "u32": "uint32_t",
    "i32": "int32_t",
    "char": "char",
    "bytes": "uint8_t",
}


def upper(name: str) -> str:
    """`BoardState` → `BOARD_STATE`."""
    return re.sub("(?<=[a-z])(?=[A-Z])", "_", name).upper()


def struct_name(cls: type[msgspec.Struct]) -> str:
    """`ArmRequest` → `smad_arm_request`."""
    return f"smad_{wire_name(cls).lower()}"


def macro(cls: type[Message]) -> str:
    """`ArmRequest` → `SMAD_ARM_REQUEST`."""
    return f"SMAD_{wire_name(cls)}"


def enums_of(codec: Codec) -> list[type[enum.IntEnum] | type[enum.IntFlag]]:
    """Return every enumeration that a field uses, by name."""
    by_name = {
        kind.__name__: kind
        for cls in codec.messages
        for field in fields_of(cls)
        for kind in (field.enum, field.wire.bits)
        if kind is not None
    }
    return [by_name[name] for name in sorted(by_name)]


def checked_enums(codec: Codec) -> list[type[enum.IntEnum]]:
    """Return the enumerations whose codes are checked on reception."""
    by_name = {
        field.enum.__name__: field.enum
        for cls in codec.messages
        for field in fields_of(cls)
        if field.enum is not None and not has_unknown(field.enum)
    }
    return [by_name[name] for name in sorted(by_name)]


def declared(field: Field) -> str:
    """Return the C declaration of a field."""
    if field.record is not None:
        return f"struct {struct_name(field.record)} {field.name};"
    count = f"[{field.wire.count}]" if field.wire.count > 1 else ""
    return f"{TYPES[field.wire.kind]} {field.name}{count};"


class Element(NamedTuple):
    """One single value, or one block, as C gets at it."""

    kind: str
    value: str
    length: int
    size: int


def elements(cls: type[msgspec.Struct], source: str) -> Iterator[Element]:
    """Yield what a message is made of, in wire order; `source` comes before each name."""
    for field in fields_of(cls):
        value, wire = f"{source}{field.name}", field.wire
        if field.record is not None:
            yield from elements(field.record, f"{value}.")
        elif wire.kind in BLOCK_KINDS or wire.count == 1:
            yield Element(wire.kind, value, wire.count, field.size)
        else:
            for index in range(wire.count):
                yield Element(wire.kind, f"{value}[{index}]", 1, field.size // wire.count)


def enum_checks(cls: type[msgspec.Struct], source: str) -> Iterator[str]:
    """Yield one C condition for each field whose code has to be a known one."""
    for field in fields_of(cls):
        if field.record is not None:
            yield from enum_checks(field.record, f"{source}{field.name}.")
        elif field.enum is not None and not has_unknown(field.enum):
            yield f"known_{upper(field.enum.__name__).lower()}({source}{field.name})"
