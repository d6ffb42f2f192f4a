"""`smad run moves`: trajectories of a TOML file, armed, recorded and disarmed by one command."""

from pathlib import Path

import click

from smad.cli.options import FILE, Command, argument, axis_option, lease_option
from smad.cli.output import ready_client
from smad.view.terminal.progress import progress


@click.command(cls=Command)
def moves(
    *,
    path: Path = argument(FILE, metavar="FILE"),
    lease: float = lease_option,
    bench: str = axis_option,
) -> None:
    """Arm, follow the trajectories of FILE from rest, record them, and disarm.

    FILE is TOML with a table [[pieces]] for each piece: `kind` is step, ramp, sine …,
    the other keys are its fields (smad docs guide/clients). `timeout_s` ends a motion that hangs.
    """
    from smad.experiments.live import LiveDriver
    from smad.experiments.moves import read_moves

    plan = read_moves(path).plan(path.stem[:60])
    with ready_client(bench) as connected, progress() as line:
        driver = LiveDriver(connected, who="smad run moves", lease_s=lease, progress=line.say)
        try:
            driver.run(plan)
        finally:
            if driver.log is not None:
                click.echo(f"recorded: {driver.log}")
