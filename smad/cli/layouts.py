"""`smad log layouts`: layouts of the bench for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from smad.cli.output import FOLDER
from smad.errors import RunLogError

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
        for name, content in contents(axes).items():
            (folder / name).write_bytes(content)
            click.echo(folder / name)
    except OSError as error:
        raise RunLogError(
            f"cannot write the layouts: {error.strerror}",
            value=str(folder),
            limit="a folder that can be written",
            action="name another FOLDER",
        ) from error
    click.echo(_HOW)
