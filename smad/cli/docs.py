"""`smad docs`: the pages that messages refer to, where there is no clone at hand."""

import click


@click.command()
@click.argument("page", required=False)
def docs(page: str | None) -> None:
    """Print a PAGE of the documentation, or list the pages."""
    from smad.cli import pages

    if page is None:
        click.echo("\n".join(pages.names()))
    else:
        click.echo_via_pager(pages.text(page))
