"""`smad docs`: the pages of this installation that messages refer to."""

import difflib
from pathlib import Path

import click

from smad.cli.options import Command, argument
from smad.errors import SmadError

_PACKAGE = Path(__file__).resolve().parent.parent
FOLDERS = (_PACKAGE / "data" / "docs", _PACKAGE.parent / "docs")
"""Where a wheel has them, and where a clone has."""


def folder() -> Path:
    """Return where the pages are. Raises SmadError for an installation without them."""
    for place in FOLDERS:
        if place.is_dir():
            return place
    raise SmadError(
        "this installation has no documentation",
        value=str(FOLDERS[0]),
        action="read the folder docs of the clone that it was installed from",
    )


def names() -> list[str]:
    """Return the names of all pages, such as `guide/clients`."""
    place = folder()
    return sorted(p.relative_to(place).with_suffix("").as_posix() for p in place.rglob("*.md"))


def text(name: str) -> str:
    """Return a page as Markdown. Raises SmadError, naming near ones, when there is none."""
    known = names()
    page = name.removeprefix("docs/").removesuffix(".md")
    if page not in known:
        near = difflib.get_close_matches(page, known, n=3)
        raise SmadError(
            "there is no such page",
            value=name,
            limit=", ".join(near) or None,
            action="list them with smad docs",
        )
    return (folder() / f"{page}.md").read_text("utf-8")


@click.command(cls=Command)
def docs(page: str | None = argument(required=False)) -> None:
    """Print a PAGE of the documentation, or list the pages."""
    if page is None:
        click.echo("\n".join(names()))
    else:
        click.echo_via_pager(text(page))
