"""A page of headings, text, tables and figures, as one HTML file without outside resources.

Everything but the figures is escaped. The figures are SVG made by `smad.report.plots`, only.
"""

from __future__ import annotations

import functools
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import SmadError

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
    """A figure: SVG text from `smad.report.plots.svg_of`, and what it shows."""

    svg: str
    caption: str = ""


@dataclass(frozen=True)
class Code:
    """Text that keeps its lines, such as a parameter file or a command."""

    text: str


Block = Text | Table | Picture | Code


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it. `anchor` makes a link of the table of contents."""

    title: str
    blocks: Sequence[Block]
    anchor: str = ""


@dataclass(frozen=True)
class Page:
    """A whole report. `facts` are shown small under the title: version, seed, files, date."""

    title: str
    sections: Sequence[Section]
    lead: str = ""
    facts: Sequence[tuple[str, str]] = field(default_factory=tuple)


_TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ page.title }}</title>
<style>
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff;
       max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin-bottom: .3rem; }
h2 { font-size: 1.25rem; margin-top: 2.4rem; border-bottom: 1px solid #d0d7de;
     padding-bottom: .2rem; }
.facts { color: #57606a; font-size: .85rem; }
.facts span { margin-right: 1.2rem; white-space: nowrap; }
nav { font-size: .9rem; columns: 2; }
nav a { display: block; color: #0b5cad; }
table { border-collapse: collapse; font-size: .9rem; margin: 1rem 0; width: 100%; }
caption { text-align: left; color: #57606a; padding-bottom: .3rem; }
th, td { border-bottom: 1px solid #d8dee4; padding: .3rem .6rem; text-align: left;
         vertical-align: top; }
th { background: #f6f8fa; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0; }
figure svg { max-width: 100%; height: auto; }
figcaption { color: #57606a; font-size: .9rem; }
.note, .warning { border-left: 4px solid #8b949e; padding: .1rem .9rem; background: #f6f8fa; }
.warning { border-color: #bf8700; background: #fff8e5; }
pre { background: #f6f8fa; padding: .8rem; overflow-x: auto; font-size: .85rem; }
.wide { overflow-x: auto; }
@media print { h2 { break-after: avoid; } figure { break-inside: avoid; } }
</style>
</head>
<body>
<h1>{{ page.title }}</h1>
{% if page.facts %}<p class="facts">{% for name, value in page.facts %}<span>{{ name }}: {{ value }}
</span>{% endfor %}</p>{% endif %}
{% if page.lead %}<p>{{ page.lead }}</p>{% endif %}
{% if page.sections | selectattr("anchor") | list | length > 2 %}<nav>
{% for section in page.sections if section.anchor %}<a href="#{{ section.anchor }}">
{{- section.title }}</a>
{% endfor %}</nav>{% endif %}
{% for section in page.sections %}
<section{% if section.anchor %} id="{{ section.anchor }}"{% endif %}>
<h2>{{ section.title }}</h2>
{% for block in section.blocks %}{% set kind = kind_of(block) %}
{% if kind == "Text" %}<p{% if block.kind != "plain" %} class="{{ block.kind }}"{% endif %}>
{{- block.text }}</p>
{% elif kind == "Table" %}<div class="wide"><table>
{% if block.caption %}<caption>{{ block.caption }}</caption>{% endif %}
<thead><tr>{% for cell in block.header %}<th
{%- if loop.index0 in block.numeric %} class="n"{% endif %}>{{ cell }}</th>{% endfor %}</tr></thead>
<tbody>{% for row in block.rows %}<tr>{% for cell in row %}<td
{%- if loop.index0 in block.numeric %} class="n"{% endif %}>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table></div>
{% elif kind == "Picture" %}<figure>{{ block.svg | safe }}
{% if block.caption %}<figcaption>{{ block.caption }}</figcaption>{% endif %}</figure>
{% else %}<pre>{{ block.text }}</pre>
{% endif %}{% endfor %}</section>
{% endfor %}
</body>
</html>
"""


@functools.cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.globals["kind_of"] = lambda block: type(block).__name__
    return environment.from_string(_TEMPLATE)


def render(page: Page) -> str:
    """The page as HTML text. The same page gives the same text."""
    return _template().render(page=page)


def write_page(page: Page, path: Path) -> Path:
    """Write the page to `path`, whole or not at all, and return the path.

    Raises SmadError, naming the path, when it cannot be written.
    """
    text = render(page)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        # mkstemp makes the file private; a report is to be read by others.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, path)
    except OSError as error:
        raise SmadError(
            f"the report cannot be written ({error.strerror})",
            value=str(path),
            action="choose another file with --report, or make room",
        ) from None
    return path


def markdown_table(table: Table) -> str:
    """The table as Markdown, for a terminal or a document."""
    lines = [
        "| " + " | ".join(table.header) + " |",
        "|" + "|".join("---:" if k in table.numeric else "---" for k in range(len(table.header)))
        + "|",
    ]  # fmt: skip
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join(lines) + "\n"


def text_table(table: Table, indent: str = "") -> str:
    """The table in columns of plain text, for a terminal."""
    rows = [tuple(table.header), *(tuple(row) for row in table.rows)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.header))]

    def line(row: Sequence[str]) -> str:
        cells = [
            cell.rjust(width) if k in table.numeric else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        return indent + "  ".join(cells).rstrip()

    rule = indent + "  ".join("-" * width for width in widths)
    return "\n".join([line(rows[0]), rule, *(line(row) for row in rows[1:])]) + "\n"
