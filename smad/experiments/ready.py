"""What a program will need after the bench was heated, looked for before it is.

Half a minute of current and a warm spring are lost when the log turns out unreadable, an extra
missing, or the page not writable at the end. Every program that heats and then reads calls
`require_ready` first.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import CommandError, ComputerError
from smad.extras import BROUGHT_BY, missing
from smad.files import require_writable

if TYPE_CHECKING:
    from smad.client import Client

_NOTHING = "nothing was armed or moved"
BYTES_A_ROW = 200
"""More than a row takes in a run log (README's first session: 118)."""
ROOM_S = 3600.0
"""So long a program may record, at the rate of the link."""


def require_ready(
    client: Client | None = None, *, extra: str = "", outputs: Iterable[Path | None] = ()
) -> None:
    """Raise SmadError unless all is there that is needed once the bench has been heated.

    `extra` names the extra of which every package must be installed. `outputs` are files that will
    be written (None: not asked for). With a `client`, the daemon's log folder must be readable from
    here and have room. Nothing is asked of the bench but its status.
    """
    if extra:
        require_packages(extra)
    for output in outputs:
        if output is not None:
            require_writable(output)
    if client is not None:
        status = client.status()
        room = BYTES_A_ROW * status.link.rate_hz * ROOM_S
        if status.recorder.folder:
            require_logs(Path(status.recorder.folder), room)


def require_packages(extra: str) -> None:
    """Raise MissingPartError when a package of the extra is not installed."""
    for package in BROUGHT_BY[extra]:
        if importlib.util.find_spec(package) is None:
            error = missing(ModuleNotFoundError(name=package), extra=extra)
            assert error is not None
            raise error


def require_logs(folder: Path, room_bytes: float) -> None:
    """Raise CommandError unless run logs that the daemon writes there can be read from here.

    Raises ComputerError when there is too little room for them.

    A folder that is not there yet is made by the daemon; what counts then is where it will be.
    """
    existing = next(place for place in (folder, *folder.parents) if _seen(place))
    if not existing.is_dir() or not os.access(existing, os.R_OK | os.X_OK):
        raise CommandError(
            "the run logs of the daemon cannot be read from here",
            value=str(existing),
            limit="a folder that you may read",
            action=f"run this as the user of the daemon, or set [recorder] folder; {_NOTHING}",
        )
    free = shutil.disk_usage(existing).free
    if free < room_bytes:
        raise ComputerError(
            f"too little room for run logs in {folder}",
            value=f"{free / 1e6:.0f} MB free",
            limit=f"{room_bytes / 1e6:.0f} MB, for an hour of this bench",
            action=f"make room, or set [recorder] folder; {_NOTHING}",
        )


def require_baseline(folder: Path) -> None:
    """Raise CommandError unless a bench was commissioned there."""
    if not (folder / "baseline.json").exists():
        raise CommandError(
            f"there is no baseline in {folder}",
            action=f"commission the bench (smad gap commission), or name another; {_NOTHING}",
        )


def _seen(place: Path) -> bool:
    try:
        return place.exists()
    except PermissionError:
        return False
