"""`smad log layouts`: layouts of the bench for other programs."""

from pathlib import Path

import click

from smad.cli.output import FOLDER
from smad.errors import RunLogError
from smad.files import write_whole

_HOW = """\
Foxglove, Lichtblick: Layouts > Import from file, then open a run log.
PlotJuggler: open a run log, or start the ZeroMQ stream, then File > Load Layout."""


@click.command()
@click.argument("folder", default="layouts", type=FOLDER)
@click.option("--axis", "axes", multiple=True, help="An axis of a bench of several; give each.")
def layouts(folder: Path, axes: tuple[str, ...]) -> None:
    """Write layouts for PlotJuggler and Foxglove into FOLDER (default: layouts).

    Of several axes, each has a tab.
    """
    from smad.view.layouts import layouts as contents

    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = contents(axes)
        for name, content in written.items():
            write_whole(folder / name, content)
    except OSError as error:
        raise RunLogError(
            f"cannot write the layouts: {error.strerror}",
            value=str(folder),
            limit="a folder that can be written",
            action="name another FOLDER",
        ) from error
    for name in written:
        click.echo(folder / name)
    click.echo(_HOW)
