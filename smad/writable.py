"""Whether a file can be written where a person named it. No folder is made for a misspelt path."""

from __future__ import annotations

import os
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
