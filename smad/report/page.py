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

from smad.errors import SmadError, refused_by_system
from smad.files import write_whole
from smad.report.panels import Panels
from smad.style import assets
from smad.style.palette import following
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

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.globals["kind_of"] = lambda block: type(block).__name__
    environment.filters["following"] = following
    return environment.from_string(_text("page.html"))


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
    with refused_by_system(SmadError, cause, value=str(path), action=action):
        write_whole(path, text)
    return path


def markdown_table(table: Table) -> str:
    """The table as Markdown, for a terminal or a document."""
    lines = [
        "| " + " | ".join(table.header) + " |",
        "|"
        + "|".join("---:" if k in table.numeric else "---" for k in range(len(table.header)))
        + "|",
    ]
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join(lines) + "\n"


def text_table(table: Table) -> str:
    """The table in columns of plain text, for a terminal."""
    rows = [tuple(table.header), *(tuple(row) for row in table.rows)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.header))]

    def line(row: Sequence[str]) -> str:
        cells = [
            cell.rjust(width) if k in table.numeric else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    rule = "  ".join("-" * width for width in widths)
    return "\n".join([line(rows[0]), rule, *(line(row) for row in rows[1:])]) + "\n"
