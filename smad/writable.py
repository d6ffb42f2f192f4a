"""Whether a file can be written where a person named it. No folder is made for a misspelt path."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from smad.errors import CommandError


def require_writable(output: Path) -> None:
    """Raise CommandError unless a file of that name can be written; nothing is made for it."""
    folder = output.parent
    if not folder.is_dir():
        raise CommandError(
            f"{output} cannot be written: there is no folder {folder}",
            action="make the folder, or name another file",
        )
    if output.is_dir():
        raise CommandError(f"{output} cannot be written: it is a folder", action="name a file")
    target = output if output.exists() else folder
    if not os.access(target, os.W_OK):
        raise CommandError(
            f"{output} cannot be written: no permission to write {target}",
            action="name another file",
        )


@contextlib.contextmanager
def replacing(output: Path) -> Iterator[Path]:
    """A file beside `output` to write, which takes its name when the block ends without an error.

    What is no file (a pipe, a terminal) is written as it is. Raises CommandError when the disk
    refuses.
    """
    if output.exists() and not output.is_file():
        yield output
        return
    beside = output.with_name(f".{output.name}.{os.getpid()}.part")
    try:
        yield beside
        beside.replace(output)
    except OSError as error:
        raise CommandError(
            f"cannot write {output}: {error.strerror or error}", action="make room, or name another"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
