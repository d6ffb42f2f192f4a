"""A small TOML file that a person wrote, as a checked record."""

import codecs
import re
import typing
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from firmware_protocol.nearest import nearest
from smad.config.bounds import field_and_words
from smad.errors import SmadError, refused_by_system
from smad.files import read_whole

_UNKNOWN = re.compile(r"Object contains unknown field `(?P<key>[^`]*)`")
MOST_BYTES = 1_000_000
T = TypeVar("T")


def read_toml(path: Path, kind: type[T], what: str, error: type[SmadError], action: str) -> T:
    """Return the record of `kind` in a file. Raises `error`.

    `what` says what the file should be ("map file"), `action` what to do where it is not.
    """
    cause = f"cannot read {what} {path}"
    with refused_by_system(error, cause, action="check the path"):
        # Some editors write a byte order mark, which a TOML reader does not take.
        text = read_whole(path, MOST_BYTES).removeprefix(codecs.BOM_UTF8)
    try:
        return msgspec.toml.decode(text, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError) as refused:
        where, why = field_and_words(str(refused))
        place = f", {where}" if where else ""
        unknown = _UNKNOWN.fullmatch(why)
        keys = _keys(kind, where) if unknown else []
        near = nearest(unknown["key"], keys) if unknown else []
        raise error(
            f"{what} {path} is not valid{place}: {why}",
            limit=", ".join(keys) or None,
            action=f"did you mean {' or '.join(near)}?" if near else action,
        ) from None


def _keys(kind: Any, where: str) -> list[str]:
    """The keys that the table at `where` (`a[...].b`) may have; none where that is not known."""
    for part in re.findall(r"[^.\[\]]+|\[\.\.\.\]", where):
        if part == "[...]":
            kind = typing.get_args(kind)[-1]
        else:
            kind = typing.get_type_hints(kind).get(part)
    return list(getattr(kind, "__struct_fields__", ()))
