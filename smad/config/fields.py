"""What the annotations of a record type say of its fields: units, bounds, kinds in words. Pure.

Forms, the command line, the configuration's errors and the generated reference read types here.
"""

import functools
from typing import Any

import msgspec
from msgspec import inspect as types


@functools.cache
def info_of(struct: type[msgspec.Struct]) -> types.StructType:
    """Return what msgspec knows of a record type."""
    info = types.type_info(struct)
    assert isinstance(info, types.StructType)
    return info


def bare(kind: types.Type) -> tuple[types.Type, dict[str, Any]]:
    """Return a type without its annotations and without "or None", and what they say of it."""
    meta: dict[str, Any] = {}
    while True:
        if isinstance(kind, types.Metadata):
            meta = {**(kind.extra_json_schema or {}), **(kind.extra or {}), **meta}
            kind = kind.type
        elif isinstance(kind, types.UnionType):
            kind = next(part for part in kind.types if not isinstance(part, types.NoneType))
        else:
            return kind, meta


def kind_in_words(kind: types.Type) -> str:
    """Return what a type allows, such as "0 to 5" or "true or false"."""
    match kind:
        case types.Metadata(type=inner):
            return kind_in_words(inner)
        case types.FloatType():
            return _range(kind) or "number"
        case types.IntType():
            span = _range(kind)
            return f"{span}, whole" if span else "whole number"
        case types.StrType(min_length=least, max_length=most, pattern=pattern):
            if pattern:
                return "text of 1 to 32 letters, digits, _ or -"
            return f"text of {most} characters" if most else "text, not empty" if least else "text"
        case types.BoolType():
            return "true or false"
        case types.NoneType():
            return "empty"
        case types.AnyType():
            return "anything"
        case types.LiteralType(values=values):
            return " or ".join(f'"{v}"' if isinstance(v, str) else str(v) for v in values)
        case types.UnionType(types=members):
            return " or ".join(kind_in_words(member) for member in members)
        case types.VarTupleType(item_type=item):
            return f"list of {kind_in_words(item)}"
        case types.TupleType(item_types=items):
            return f"list of {len(items)}"
        case types.DictType(key_type=key, value_type=value):
            return f"{kind_in_words(value)} by {kind_in_words(key)}"
        case types.StructType(cls=cls):
            return str(cls.__name__)
        case types.EnumType(cls=cls):
            return f"one of {', '.join(str(member.value) for member in cls)}"
    raise TypeError(f"{kind} has no description")


def _range(kind: types.FloatType | types.IntType) -> str:
    low = f"above {kind.gt:g}" if kind.gt is not None else ""
    low = f"{kind.ge:.15g}" if kind.ge is not None else low
    high = f"below {kind.lt:g}" if kind.lt is not None else ""
    high = f"{kind.le:.15g}" if kind.le is not None else high
    return " to ".join(part for part in (low, high) if part)
