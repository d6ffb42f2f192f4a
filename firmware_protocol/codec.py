"""Messages to payload bytes and back, made from the table of messages.

For each class one `struct` format and two small functions are generated: a chain of generic calls
for each field would take several times as long, and STATE comes up to 500 times a second.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from firmware_protocol.errors import PayloadError, SchemaError
from firmware_protocol.framing import MAX_PAYLOAD, encode_frame
from firmware_protocol.messages import FIRST_BOARD_NUMBER, MESSAGES, Message
from firmware_protocol.wire import NUMBER_CODES, Direction, Field, fields_of, has_unknown


class Layout:
    """How one message looks on the wire: `pack` and `unpack`, and its size in bytes."""

    def __init__(self, cls: type[Message]) -> None:
        self.cls = cls
        self.number = cls.info.number
        self.fields = fields_of(cls)
        namespace: dict[str, Any] = {"_text": _text, "_padded": _padded}
        codes: list[str] = []
        arguments: list[str] = []
        result = _generate(cls, "m", codes, arguments, namespace)
        self.format = "<" + "".join(codes)
        compiled = struct.Struct(self.format)
        self.size = compiled.size
        names = "".join(f"v{index}, " for index in range(_value_count(self.fields)))
        namespace |= {"_pack": compiled.pack, "_unpack": compiled.unpack}
        unpacking = f"    {names}= _unpack(payload)\n" if names else "    _unpack(payload)\n"
        exec(
            f"def pack(m):\n    return _pack({', '.join(arguments)})\n"
            f"def unpack(payload):\n{unpacking}    return {result}\n",
            namespace,
        )
        self.pack: Callable[[Any], bytes] = namespace["pack"]
        self.unpack: Callable[[bytes], Any] = namespace["unpack"]


class Codec:
    """All messages of one table, by number and by class.

    `pack`/`unpack` raise PayloadError, never anything else, whatever they are given.
    """

    def __init__(self, messages: Sequence[type[Message]] = MESSAGES) -> None:
        self.messages = tuple(messages)
        self.layouts: dict[int, Layout] = {}
        self._by_class: dict[type[Message], Layout] = {}
        for cls in self.messages:
            layout = Layout(cls)
            if layout.number in self.layouts:
                other = self.layouts[layout.number].cls.__name__
                raise SchemaError(
                    f"{cls.__name__} and {other} both have number 0x{layout.number:02x}; "
                    "give one of them a free number"
                )
            if layout.size > MAX_PAYLOAD:
                raise SchemaError(
                    f"{cls.__name__} takes {layout.size} bytes, the limit is {MAX_PAYLOAD}; "
                    "split it in two"
                )
            to_host = cls.info.direction is Direction.TO_HOST
            if to_host != (layout.number >= FIRST_BOARD_NUMBER):
                raise SchemaError(
                    f"{cls.__name__} goes {cls.info.direction} and has number "
                    f"0x{layout.number:02x}; numbers from 0x{FIRST_BOARD_NUMBER:02x} on are the "
                    "board's"
                )
            self.layouts[layout.number] = layout
            self._by_class[cls] = layout

    def layout(self, cls: type[Message]) -> Layout:
        """Return the layout of a class, SchemaError if the table does not hold it."""
        try:
            return self._by_class[cls]
        except KeyError:
            raise SchemaError(f"{cls.__name__} is not in this table of messages") from None

    def knows(self, number: int) -> bool:
        """Whether the table has a message of this number."""
        return number in self.layouts

    def pack(self, message: Message) -> bytes:
        """Return the payload. Raises PayloadError naming the field that does not fit."""
        layout = self.layout(type(message))
        try:
            return layout.pack(message)
        except (struct.error, TypeError, ValueError, AttributeError, IndexError) as error:
            raise PayloadError(_misfit(message, layout.fields, error)) from None

    def unpack(self, number: int, payload: bytes) -> Message:
        """Return the message. Raises PayloadError for an unknown number or a bad payload."""
        layout = self.layouts.get(number)
        if layout is None:
            raise PayloadError(f"no message has the number 0x{number:02x}")
        try:
            message: Message = layout.unpack(payload)
        except struct.error:
            raise PayloadError(
                f"{layout.cls.__name__} has {layout.size} bytes, this payload has {len(payload)}"
            ) from None
        except KeyError as error:
            raise PayloadError(f"{layout.cls.__name__}: unknown code {error}") from None
        return message

    def frame(self, message: Message, seq: int, session: int) -> bytes:
        """Return the whole frame as it goes on the wire. Raises PayloadError."""
        return encode_frame(type(message).info.number, seq, session, self.pack(message))


def _generate(
    cls: type[msgspec.Struct],
    source: str,
    codes: list[str],
    arguments: list[str],
    namespace: dict[str, Any],
    *,
    first: int = 0,
) -> str:
    """Append format codes and pack arguments; return the expression that builds `cls`."""
    parts: list[str] = []
    index = first
    for field in fields_of(cls):
        value = f"{source}.{field.name}"
        if field.record is not None:
            parts.append(_generate(field.record, value, codes, arguments, namespace, first=index))
            index += _value_count(fields_of(field.record))
        elif field.is_array:
            codes.append(NUMBER_CODES[field.wire.kind] * field.wire.count)
            arguments.append(f"*{value}")
            items = ", ".join(f"v{index + i}" for i in range(field.wire.count))
            parts.append(f"({items})")
            index += field.wire.count
        else:
            code, argument, part = _single(field, value, f"v{index}", namespace)
            codes.append(code)
            arguments.append(argument)
            parts.append(part)
            index += 1
    namespace[cls.__name__] = cls
    return f"{cls.__name__}({', '.join(parts)})"


def _single(field: Field, value: str, name: str, namespace: dict[str, Any]) -> tuple[str, str, str]:
    kind, count = field.wire.kind, field.wire.count
    if kind == "char":
        return f"{count}s", f"_padded({value}.encode('ascii'), {count})", f"_text({name})"
    if kind == "bytes":
        return f"{count}s", f"_padded({value}, {count})", name
    if field.enum is not None:
        table = f"_enum_{field.enum.__name__}"
        namespace[table] = _by_code(field.enum)
        return NUMBER_CODES[kind], value, f"{table}[{name}]"
    return NUMBER_CODES[kind], value, name


class _Codes(dict[int, enum.IntEnum]):
    """Members by code; what is not there is UNKNOWN."""

    def __missing__(self, code: int) -> enum.IntEnum:
        return self[0]


def _by_code(kind: type[enum.IntEnum]) -> dict[int, enum.IntEnum]:
    """Return the members by code.

    An enumeration that has an UNKNOWN takes any code: IDENT and ERROR of a board of the future
    must be readable, or the message that says why it cannot be used would be lost.
    """
    members: dict[int, enum.IntEnum] = {member.value: member for member in kind}
    return _Codes(members) if has_unknown(kind) else members


def _value_count(fields: Sequence[Field]) -> int:
    return sum(
        _value_count(fields_of(field.record))
        if field.record is not None
        else (field.wire.count if field.is_array else 1)
        for field in fields
    )


def _text(block: bytes) -> str:
    return block.rstrip(b"\0").decode("ascii", "replace")


def _padded(block: bytes, size: int) -> bytes:
    if len(block) > size:
        raise ValueError(f"{len(block)} bytes do not fit into {size}")
    return block


def _misfit(message: Message, fields: Sequence[Field], error: Exception) -> str:
    """Return which field cannot be packed and why. Only called when one cannot."""
    name = type(message).__name__
    for field in fields:
        value = getattr(message, field.name)
        if field.wire.kind not in NUMBER_CODES:
            continue
        low, high = field.span
        values = value if field.is_array and isinstance(value, tuple) else (value,)
        if len(values) != field.wire.count:
            return f"{name}.{field.name} is {value!r}; it has {field.wire.count} values"
        for item in values:
            if not isinstance(item, int) or not low <= item <= high:
                return f"{name}.{field.name} is {value!r}; it takes whole numbers {low}…{high}"
    return f"{name} does not fit the wire: {error}"


CODEC = Codec()
"""The codec of this version's table."""
