"""`smad log layouts`: layouts of the bench for other programs."""

from pathlib import Path

import click

from smad.cli.options import FOLDER, Command, argument, option
from smad.errors import RunLogError, refused_by_system
from smad.files import write_whole

_HOW = """\
Foxglove, Lichtblick: Layouts > Import from file, then open a run log.
PlotJuggler: open a run log, or start the ZeroMQ stream, then File > Load Layout."""


@click.command(cls=Command)
def layouts(
    folder: Path = argument(FOLDER, default="layouts"),
    axes: tuple[str, ...] = option(
        "--axis", str, "An axis, if the bench has several; may be repeated.", multiple=True
    ),
) -> None:
    """Write layouts for PlotJuggler and Foxglove into FOLDER.

    With several axes, each has a tab.
    """
    from smad.view.layouts import layouts as contents

    cause, action = "cannot write the layouts", "name another FOLDER"
    with refused_by_system(RunLogError, cause, value=str(folder), action=action):
        folder.mkdir(parents=True, exist_ok=True)
        written = contents(axes)
        for name, content in written.items():
            write_whole(folder / name, content)
    for name in written:
        click.echo(folder / name)
    click.echo(_HOW)
