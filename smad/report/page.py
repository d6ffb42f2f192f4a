"""A page of headings, text, tables and figures, as one HTML file without outside resources.

Everything but the figures is escaped. The figures are SVG made by `smad.report.plots`, which the
page saves as SVG, PDF or PNG in the colours of print, or panels that the page draws itself.
"""

from __future__ import annotations

import functools
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import SmadError
from smad.files import named_output
from smad.report.panels import Panels
from smad.style import assets
from smad.style.palette import following
from smad.units import unparted
from smad.version import VERSION

if TYPE_CHECKING:
    from jinja2 import Template


@dataclass(frozen=True)
class Text:
    """A paragraph. `kind` "note" sets it apart, "warning" does so more strongly."""

    text: str
    kind: str = "plain"


@dataclass(frozen=True)
class Table:
    """A table. Cells are shown as given; columns in `numeric` are aligned to the right."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    numeric: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture:
    """A figure as SVG text, and what it shows. `smad.report.plots.picture` makes it.

    `name` is that of its files when the page saves it; without a `pdf` it is not saved.
    """

    svg: str
    caption: str = ""
    name: str = ""
    pdf: bytes = b""

    @property
    def pdf_address(self) -> str:
        """The PDF as the address of a link."""
        return f"data:application/pdf;base64,{b64encode(self.pdf).decode()}"


@dataclass(frozen=True)
class Code:
    """Text that keeps its lines, such as a parameter file or a command."""

    text: str


@dataclass(frozen=True)
class Fold:
    """Blocks that are shown on demand, under a title."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Beside:
    """Cells of blocks, beside each other where the screen is wide enough."""

    cells: Sequence[Sequence[Block]]


Block = Text | Table | Picture | Panels | Code | Fold | Beside


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it. `anchor` makes a link of the table of contents.

    A `folded` section is shown on demand.
    """

    title: str
    blocks: Sequence[Block]
    anchor: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Page:
    """A whole report. `facts` are shown small under the title: seed, files, dates."""

    title: str
    sections: Sequence[Section]
    lead: str = ""
    facts: Sequence[tuple[str, str]] = field(default_factory=tuple)


@functools.cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, finalize=_shown
    )
    environment.globals["kind_of"] = lambda block: type(block).__name__
    environment.filters["following"] = following
    return environment.from_string(_text("page.html"))


def _shown(value: object) -> object:
    # What is marked as safe or escaped is a figure, or must stay as it is, as a command.
    return unparted(value) if type(value) is str else value


def _text(name: str) -> str:
    return (Path(__file__).parent / "static" / name).read_text("utf-8")


def _all_of(blocks: Sequence[Block]) -> Iterator[Block]:
    """Blocks with those inside them."""
    for block in blocks:
        yield block
        if isinstance(block, Fold):
            yield from _all_of(block.blocks)
        elif isinstance(block, Beside):
            for cell in block.cells:
                yield from _all_of(cell)


def render(page: Page, written: str = "") -> str:
    """The page as HTML text; the same page gives the same text. `written` says when, at its end."""
    blocks = [block for section in page.sections for block in _all_of(section.blocks)]
    interactive = any(isinstance(block, Panels) for block in blocks)
    saves = any(isinstance(block, Picture) and block.pdf for block in blocks)
    style = assets.style(plots=interactive) + _text("page.css")
    return _template().render(
        page=page,
        style=style,
        script=(assets.script() if interactive else "") + (_text("save.js") if saves else ""),
        made=f"smad {VERSION}{written and ', '}{written}",
    )


def write_page(page: Page, path: Path) -> Path:
    """Write the page to `path`, whole or not at all, and return the path.

    Raises SmadError, naming the path, when it cannot be written.
    """
    text = render(page, f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC")
    cause, action = "the report cannot be written", "name another file, or make room"
    with named_output(path, SmadError, cause, action, value=str(path)) as partial:
        partial.write_text(text, "utf-8")
    return path
