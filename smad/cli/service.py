"""`smad service`: the files that let systemd and udev look after a bench."""

from pathlib import Path

import click

from smad.cli.options import FOLDER, Group, flag, option

_NEXT = """\
Next: add the vendor and product of your board, if need be (lsusb), to the udev rule, then
  udevadm control --reload && udevadm trigger
  systemctl daemon-reload"""


@click.group(cls=Group)
def service() -> None:
    """Install the systemd units and the udev rule."""


@service.command()
def install(
    root: Path = option(
        "--root", "Root of the system, to build an image.", FOLDER, default=Path("/")
    ),
    overwrite: bool = flag("--overwrite", "Replace files that were edited."),
) -> None:
    """Write the files where the system looks for them; needs root.

    The units of daemon, queue and hooks start the smad that runs this command.
    """
    from smad.processes import service as service_files

    for path in service_files.install(root, overwrite=overwrite):
        click.echo(path)
    click.echo(_NEXT)


@service.command()
def show() -> None:
    """Print the files as `install` would write them."""
    from smad.processes import service as service_files

    for name, place in service_files.PLACES.items():
        click.echo(f"# /{place}/{name}\n{service_files.content(name)}")
