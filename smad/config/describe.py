"""What the types say about each key: section, default, allowed values, purpose.

The commented default file, the table in the guide and the limits in error messages come from here.
"""

import functools
import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import inspect as types

from smad.config.fields import bare, info_of, kind_in_words
from smad.config.model import Config


@dataclass(frozen=True)
class Key:
    """One key of the configuration. `section` is dotted (`control.cooling`), as in TOML."""

    section: str
    name: str
    default: Any
    allowed: str
    description: str


@dataclass(frozen=True)
class SectionDescription:
    """One table of the configuration: dotted name, purpose, keys in the order of the types.

    `many`: there may be any number of them, `[[name]]` in TOML.
    """

    name: str
    purpose: str
    keys: tuple[Key, ...]
    many: bool = False

    @property
    def heading(self) -> str:
        """Its line in a TOML file."""
        return f"[[{self.name}]]" if self.many else f"[{self.name}]"


@functools.cache
def sections() -> tuple[SectionDescription, ...]:
    """Every table of the configuration, in file order."""
    return tuple(_walk(Config, ""))


def find_section(name: str) -> SectionDescription | None:
    """The table of that dotted name, or None."""
    return next((section for section in sections() if section.name == name), None)


def _walk(
    struct: type[msgspec.Struct], name: str, *, many: bool = False
) -> Iterator[SectionDescription]:
    keys = []
    below = []
    for field in info_of(struct).fields:
        kind = field.type
        listed = isinstance(kind, types.VarTupleType)
        inner = kind.item_type if isinstance(kind, types.VarTupleType) else kind
        if isinstance(inner, types.StructType):
            below.append((inner.cls, f"{name}.{field.name}".lstrip("."), listed))
        else:
            keys.append(_key(name, field))
    if name:
        yield SectionDescription(name, inspect.getdoc(struct) or "", tuple(keys), many)
    for child, child_name, listed in below:
        yield from _walk(child, child_name, many=listed)


def _key(section: str, field: types.Field) -> Key:
    kind, meta = bare(field.type)
    default = field.default
    if default is msgspec.NODEFAULT and field.default_factory is not msgspec.NODEFAULT:
        default = field.default_factory()
    allowed = "tables of numbers" if isinstance(kind, types.DictType) else kind_in_words(kind)
    return Key(section, field.name, default, allowed, meta.get("description", ""))
