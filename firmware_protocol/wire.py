"""How a typed record says what it looks like on the wire, and how that is read back.

A message is a frozen `msgspec.Struct` whose fields are annotated:

    i_meas_mA: Annotated[tuple[int, int], Wire("i16", count=2, unit="mA", doc="…")]

`fields_of(cls)` turns the annotations into `Field` records; everything else (the codec, the JSON
description, the C header, the tables of the document) is made from those.
"""

from __future__ import annotations

import enum
import functools
import struct
from dataclasses import dataclass
from typing import Any, get_type_hints

import msgspec

from firmware_protocol.errors import SchemaError

NO_VALUE = {"u8": 0xFF, "u16": 0xFFFF, "i16": -(2**15), "i32": -(2**31)}
"""The reserved value of each kind, for fields that may have no valid reading."""

NUMBER_CODES = {"u8": "B", "u16": "H", "i16": "h", "u32": "I", "i32": "i"}
"""Kinds of number and their `struct` codes. Always little-endian."""

BLOCK_KINDS = ("char", "bytes")
"""Kinds of fixed length that are one value: text padded with zero bytes, and plain bytes."""

RECORD_KIND = "record"
"""The kind of a field that is itself a message."""


class Direction(enum.StrEnum):
    """Who sends a message."""

    TO_BOARD = "host→board"
    TO_HOST = "board→host"


@dataclass(frozen=True, kw_only=True)
class MessageInfo:
    """What the table says of a message besides its fields.

    `replies` names the messages that answer it (ERROR can answer any request); `frozen` messages
    keep their number and layout in all versions of the protocol. `per_s`: how many a second share
    the line with the samples and setpoints.
    """

    number: int
    direction: Direction
    pace: str
    replies: tuple[str, ...] = ()
    frozen: bool = False
    per_s: int = 0


@dataclass(frozen=True)
class Wire:
    """One field on the wire: kind, count, unit, meaning, the value that says "no reading"."""

    kind: str
    doc: str = ""
    unit: str = ""
    count: int = 1
    invalid: int | None = None
    bits: type[enum.IntEnum] | type[enum.IntFlag] | None = None


@dataclass(frozen=True)
class Field:
    """A field of a message, as read from its annotation."""

    name: str
    wire: Wire
    enum: type[enum.IntEnum] | None = None
    record: type[msgspec.Struct] | None = None

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        if self.record is not None:
            return sum(field.size for field in fields_of(self.record))
        if self.wire.kind in BLOCK_KINDS:
            return self.wire.count
        return struct.calcsize("<" + NUMBER_CODES[self.wire.kind]) * self.wire.count

    @property
    def is_array(self) -> bool:
        """Whether the value is a tuple of numbers."""
        return self.wire.kind in NUMBER_CODES and self.wire.count > 1

    @property
    def span(self) -> tuple[int, int]:
        """Smallest and largest number that the field can hold."""
        bits = 8 * struct.calcsize("<" + NUMBER_CODES[self.wire.kind])
        if self.wire.kind.startswith("u"):
            return 0, 2**bits - 1
        return -(2 ** (bits - 1)), 2 ** (bits - 1) - 1


def fields_of(cls: type[msgspec.Struct]) -> tuple[Field, ...]:
    """Return the fields of a message in wire order.

    Raises SchemaError for a field without a `Wire` annotation or with an unknown kind.
    """
    return _fields_of(cls)


# Each new session asks for all of them, and reading annotations takes ten milliseconds.
@functools.cache
def _fields_of(cls: type[msgspec.Struct]) -> tuple[Field, ...]:
    hints = get_type_hints(cls, include_extras=True)
    return tuple(_field(cls, name, hints[name]) for name in cls.__struct_fields__)


def _field(cls: type[msgspec.Struct], name: str, hint: Any) -> Field:
    wires = [item for item in getattr(hint, "__metadata__", ()) if isinstance(item, Wire)]
    if len(wires) != 1:
        raise SchemaError(f"{cls.__name__}.{name} has {len(wires)} Wire annotations; give it one")
    wire = wires[0]
    base = hint.__origin__
    if wire.kind == RECORD_KIND:
        return Field(name, wire, record=base)
    if wire.kind not in NUMBER_CODES and wire.kind not in BLOCK_KINDS:
        kinds = ", ".join((*NUMBER_CODES, *BLOCK_KINDS, RECORD_KIND))
        raise SchemaError(f"{cls.__name__}.{name} is of kind {wire.kind!r}; known are {kinds}")
    is_enum = isinstance(base, type) and issubclass(base, enum.IntEnum)
    return Field(name, wire, enum=base if is_enum else None)


def has_unknown(kind: type[enum.IntEnum]) -> bool:
    """Whether codes that are not in the enumeration are read as its UNKNOWN."""
    return "UNKNOWN" in kind.__members__ and kind["UNKNOWN"] == 0
