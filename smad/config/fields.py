"""The fields of a record type, with what their annotations say. Pure."""

from __future__ import annotations

from typing import Any

import msgspec
from msgspec import inspect as types


def fields_of(struct: type[msgspec.Struct]) -> tuple[types.Field, ...]:
    """Return the fields of a record type."""
    return info_of(struct).fields


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
