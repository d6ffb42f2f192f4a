"""A file of moves: trajectories that one arming plays, as TOML."""

from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from smad.config import Config
from smad.config.toml_file import read_toml
from smad.control.commands import Follow, Trajectory
from smad.control.plan import Do, Plan, UntilDone
from smad.control.trajectories import ReferenceQueue
from smad.errors import CommandError

LATE_S = 5.0


class MovesFile(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a file of moves holds: pieces in their order, each a table `[[pieces]]`."""

    pieces: Annotated[tuple[Trajectory, ...], Meta(min_length=1, max_length=1000)]
    timeout_s: Annotated[float, Meta(gt=0.0, le=86_400.0)] = 3600.0

    def plan(self, name: str) -> Plan:
        """The moves as a plan, from rest."""
        follow = Do(Follow(trajectories=self.pieces))
        return Plan(name, (follow, UntilDone(self.timeout_s + LATE_S)))

    def require_within(self, config: Config) -> None:
        """Raise CommandError, naming the field, when a piece breaks a limit of the bench."""
        queue = ReferenceQueue(config.limits, config.control.handover_rate_mm_per_s)
        queue.compiled(Follow(trajectories=self.pieces), 0.0)


def read_moves(path: Path) -> MovesFile:
    """Return the moves of a file. Raises CommandError, naming the piece that is not valid."""
    action = "give tables [[pieces]]; smad docs guide/queue has an example"
    return read_toml(path, MovesFile, "file of moves", CommandError, action)
