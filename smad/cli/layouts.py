"""`smad log layouts`: layouts of the bench for other programs."""

from pathlib import Path

import click

from smad.cli.options import FOLDER, Command, argument, option

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
    from smad.view.layouts import write_layouts

    for path in write_layouts(folder, axes):
        click.echo(path)
    click.echo(_HOW)
