"""Files that people write: read and parsed, with one error for all that can be wrong with them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

LARGEST_FILE_BYTES = 1_000_000
"""No parameter or model file comes near; a device or a recording given by mistake does."""

_ESCAPED = re.compile(r'[\x00-\x1f\x7f"\\]')


class TextFileError(Exception):
    """Why a file cannot be used, in words that go behind its name."""


def parsed(path: Path, language: str, parse: Callable[[str], Any]) -> Any:
    """Return what `parse` makes of the file's text. Raises TextFileError, and nothing else."""
    text = _text(path)
    try:
        return parse(text)
    except RecursionError:
        raise TextFileError(f"is not {language}: too many brackets within brackets") from None
    except ValueError as error:
        raise TextFileError(f"is not {language}: {error}") from None


def beside(path: Path, name: str) -> Path | None:
    """Return the file of that name beside `path`, None if there is none."""
    try:
        file = path.parent / name
        return file if file.exists() else None
    except (OSError, ValueError):
        # Too long for a file name, or with a zero byte in it.
        return None


def quoted(text: str) -> str:
    """Return `text` as a TOML string."""
    return '"' + _ESCAPED.sub(lambda match: f"\\u{ord(match[0]):04x}", text) + '"'


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise TextFileError(f"cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise TextFileError(f"cannot be read ({error})") from None
    if len(data) > LARGEST_FILE_BYTES:
        raise TextFileError(f"is over {LARGEST_FILE_BYTES} bytes, too large for what it should be")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TextFileError(f"is not UTF-8 text (byte {error.start})") from None
