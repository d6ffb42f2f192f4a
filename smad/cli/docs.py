"""`smad docs`: the pages that messages refer to, where there is no clone at hand."""

import click

from smad.cli.options import Command, argument


@click.command(cls=Command)
def docs(page: str | None = argument(required=False)) -> None:
    """Print a PAGE of the documentation, or list the pages."""
    from smad.cli import pages

    if page is None:
        click.echo("\n".join(pages.names()))
    else:
        click.echo_via_pager(pages.text(page))
