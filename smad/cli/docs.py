"""`smad docs`: the pages of this installation that messages refer to."""

import click

from smad.cli import pages
from smad.cli.options import Command, argument


@click.command(cls=Command)
def docs(page: str | None = argument(required=False)) -> None:
    """Print a PAGE of the documentation, or list the pages."""
    if page is None:
        click.echo("\n".join(pages.names()))
    else:
        click.echo_via_pager(pages.text(page))
