"""`smad run moves`: trajectories of a TOML file, armed, recorded and disarmed by one command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click
import msgspec
from msgspec import Meta, Struct

from smad.cli.output import axis_option, lease_option, leased_driver, progress, ready_client
from smad.control.commands import Follow, Trajectory
from smad.control.plan import Do, Plan, UntilDone
from smad.errors import CommandError

if TYPE_CHECKING:
    from smad.config import Config

LATE_S = 5.0


class MovesFile(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a file of moves holds: pieces in their order, each a table `[[pieces]]`."""

    pieces: Annotated[tuple[Trajectory, ...], Meta(min_length=1, max_length=1000)]
    timeout_s: Annotated[float, Meta(gt=0.0, le=86_400.0)] = 3600.0


@click.command()
@click.argument("path", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE")
@lease_option
@axis_option
def moves(*, path: Path, lease: float, bench: str) -> None:
    """Arm, follow the trajectories of FILE from rest, record them, and disarm.

    FILE is TOML with a table [[pieces]] for each piece: `kind` is step, ramp, sine …,
    the other keys are its fields (smad docs guide/clients). `timeout_s` ends a motion that hangs.
    """
    file = read_moves(path)
    plan = Plan(
        path.stem[:60],
        (Do(Follow(trajectories=file.pieces)), UntilDone(file.timeout_s + LATE_S)),
    )
    with ready_client(bench) as connected, progress() as line:
        driver = leased_driver(connected, "smad run moves", lease, line.say)
        try:
            driver.run(plan)
        finally:
            if driver.log is not None:
                click.echo(f"recorded: {driver.log}")


def require_within(file: MovesFile, config: Config) -> None:
    """Raise CommandError, naming the field, when a piece breaks a limit of the configuration."""
    from smad.control.trajectories import ReferenceQueue

    queue = ReferenceQueue(config.limits, config.control.handover_rate_mm_per_s)
    queue.compiled(Follow(trajectories=file.pieces), 0.0)


def read_moves(path: Path) -> MovesFile:
    """Return the moves of a file. Raises CommandError, naming the piece that is not valid."""
    try:
        return msgspec.toml.decode(path.read_bytes(), type=MovesFile)
    except OSError as error:
        raise CommandError(
            f"cannot read {path}: {error.strerror}", action="give a TOML file"
        ) from None
    except (msgspec.MsgspecError, ValueError) as error:
        raise CommandError(
            f"{path} is no file of moves: {error}",
            action="give tables [[pieces]]; smad docs guide/queue has an example",
        ) from None
