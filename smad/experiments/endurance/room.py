"""What an endurance run takes on the disk: told before it begins, and reserved."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from smad.errors import CommandError
from smad.experiments.endurance.profile import Profile
from smad.experiments.ready import BYTES_A_ROW

BYTES_A_CYCLE = 160
"""More than a line of `cycles.csv` takes."""


@dataclass(frozen=True)
class Room:
    """Bytes: of the run logs that stay, of the statistics, and of the block being recorded."""

    logs: float
    statistics: float
    block: float

    @property
    def total(self) -> float:
        """All that must be there before it begins."""
        return self.logs + self.statistics + self.block

    def in_words(self) -> str:
        """Return it in one line."""
        parts = (self.logs, self.statistics, self.block)
        logs, statistics, block = (f"{part / 1e6:.1f} MB" for part in parts)
        return f"{logs} of run logs, {statistics} of statistics, {block} while a block is recorded"


def room_for(profile: Profile, cycles: int, full_every: int, block: int, rate_hz: float) -> Room:
    """Return what `cycles` take when every `full_every`-th stays in full."""
    bytes_a_cycle = profile.period_s * rate_hz * BYTES_A_ROW
    return Room(
        logs=bytes_a_cycle * -(-cycles // full_every),
        statistics=float(BYTES_A_CYCLE * cycles),
        block=bytes_a_cycle * block if full_every > 1 else 0.0,
    )


class Reserve:
    """A file that keeps the room until the run needs it; it shrinks with what was written."""

    def __init__(self, path: Path, room: Room) -> None:
        self._path = path
        self._room = room
        free = shutil.disk_usage(path.parent).free
        if free < room.total:
            raise CommandError(
                f"too little room for this run in {path.parent}",
                value=f"{free / 1e6:.0f} MB free",
                limit=f"{room.total / 1e6:.0f} MB: {room.in_words()}",
                action="make room, give fewer cycles, or a larger --full-every; nothing was moved",
            )
        # What a block takes while it is recorded must stay free for the daemon.
        self._bytes = int(room.logs + room.statistics)
        try:
            with path.open("wb") as file:
                if self._bytes:
                    os.posix_fallocate(file.fileno(), 0, self._bytes)
        except OSError as error:
            path.unlink(missing_ok=True)
            raise CommandError(
                f"the room cannot be reserved: {error.strerror}",
                value=str(path),
                action="make room on the disk; nothing was moved",
            ) from None

    def use(self, share: float) -> None:
        """Give back the share of the run that lies ahead, 0 to 1."""
        os.truncate(self._path, int(self._bytes * (1.0 - min(max(share, 0.0), 1.0))))

    def close(self) -> None:
        """Give back what is left."""
        self._path.unlink(missing_ok=True)
