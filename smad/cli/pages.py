"""The pages of this installation, by name."""

import difflib
from pathlib import Path

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
    pages = names()
    page = name.removeprefix("docs/").removesuffix(".md")
    if page not in pages:
        near = difflib.get_close_matches(page, pages, n=3)
        raise SmadError(
            "there is no such page",
            value=name,
            limit=", ".join(near) or None,
            action="list them with smad docs",
        )
    return (folder() / f"{page}.md").read_text("utf-8")
