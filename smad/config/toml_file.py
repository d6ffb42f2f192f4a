"""A small TOML file that a person wrote, as a checked record."""

from pathlib import Path
from typing import TypeVar

import msgspec

from smad.config.bounds import field_and_words, without_mark
from smad.errors import SmadError

MOST_BYTES = 1_000_000
T = TypeVar("T")


def read_toml(path: Path, kind: type[T], what: str, error: type[SmadError], action: str) -> T:
    """Return the record of `kind` in a file. Raises `error`.

    `what` says what the file should be ("map file"), `action` what to do where it is not.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
    except OSError as refused:
        raise error(
            f"cannot read {what} {path}: {refused.strerror}", action="check the path"
        ) from refused
    if len(text) > MOST_BYTES:
        raise error(f"{path} is too long for a {what}", limit=f"{MOST_BYTES} bytes")
    try:
        return msgspec.toml.decode(without_mark(text), type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError) as refused:
        where, why = field_and_words(str(refused))
        place = f", {where}" if where else ""
        raise error(f"{what} {path} is not valid{place}: {why}", action=action) from None
