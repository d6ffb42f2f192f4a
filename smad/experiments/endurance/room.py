"""What an endurance run takes on the disk: told before it begins, and reserved."""

import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from smad.config import Config
from smad.errors import CommandError, refused_by_system
from smad.experiments.endurance.profile import Profile
from smad.experiments.ready import BYTES_A_ROW

BYTES_A_CYCLE = 160
"""More than a line of `cycles.csv` takes."""
REST_S = 60.0
"""Before each block the springs rest, armed, for about so long; the daemon records that, too."""


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


def longest_block_s(config: Config) -> float:
    """Return how long one arming and one file of the run log may last on this bench, s."""
    file_s = config.recorder.max_file_MB * 1e6 / (config.link.rate_hz * BYTES_A_ROW)
    return min(config.limits.on_time_max_s, 60.0 * config.recorder.max_file_min, file_s)


def room_for(profile: Profile, cycles: int, full_every: int, block: int, rate_hz: float) -> Room:
    """Return what `cycles` take when every `full_every`-th stays in full."""
    bytes_a_s = rate_hz * BYTES_A_ROW
    bytes_a_cycle = profile.period_s * bytes_a_s
    return Room(
        logs=bytes_a_cycle * -(-cycles // full_every) + REST_S * bytes_a_s * -(-cycles // block),
        statistics=float(BYTES_A_CYCLE * cycles),
        block=bytes_a_cycle * block if full_every > 1 else 0.0,
    )


class Reserve:
    """Room on the disk of `folder` that shrinks with what was written.

    Its file has no name, so that the room of a run that is killed comes back with its process.
    """

    def __init__(self, folder: Path, room: Room) -> None:
        # The daemon makes the folder with its first log: what counts is the disk where it will be.
        existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
        with refused_by_system(
            CommandError,
            "nothing can be written where the run logs go",
            value=str(folder),
            action="run it as a user who may write there; nothing was moved",
        ):
            free = shutil.disk_usage(existing).free
            self._file = tempfile.TemporaryFile(dir=existing)  # noqa: SIM115 (closed by `close`)
        if free < room.total:
            self._file.close()
            raise CommandError(
                f"too little room for this run in {folder}",
                value=f"{free / 1e6:.0f} MB free",
                limit=f"{room.total / 1e6:.0f} MB: {room.in_words()}",
                action="make room, give fewer cycles, or a larger --full-every; nothing was moved",
            )
        # What a block takes while it is recorded must stay free for the daemon.
        self._bytes = int(room.logs + room.statistics)
        try:
            if self._bytes:
                os.posix_fallocate(self._file.fileno(), 0, self._bytes)
        except OSError as error:
            self._file.close()
            raise CommandError(
                f"the room cannot be reserved: {error.strerror}",
                value=str(folder),
                action="make room on the disk; nothing was moved",
            ) from None

    def use(self, share: float) -> None:
        """Give back the share of the run that lies behind, 0 to 1."""
        os.ftruncate(self._file.fileno(), int(self._bytes * (1.0 - min(max(share, 0.0), 1.0))))

    def close(self) -> None:
        """Give back what is left."""
        self._file.close()
