"""Tables that fit the terminal; plain text where the output is none, for a pipe or a file."""

from __future__ import annotations

import io
import shutil
import sys
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from smad.report.page import Table


def print_table(table: Table) -> None:
    """Print a table: within the terminal's width, or in plain columns where there is none."""
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        click.echo(fitted(table.header, table.rows, table.numeric, width))
        return
    from smad.report.page import text_table

    click.echo(text_table(table))


def fitted(
    header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Collection[int], width: int
) -> str:
    """Return the table in lines of at most `width` characters; long cells take several lines."""
    from rich import box
    from rich.console import Console
    from rich.table import Table as Drawn
    from rich.text import Text

    drawn = Drawn(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for k, name in enumerate(header):
        side = "right" if k in numeric else "left"
        drawn.add_column(Text(name), justify=side, overflow="fold")  # type: ignore[arg-type]
    for row in rows:
        drawn.add_row(*map(Text, row))
    out = io.StringIO()
    Console(file=out, width=width, color_system=None, legacy_windows=False).print(drawn)
    return "\n".join(line.rstrip() for line in out.getvalue().splitlines()) + "\n"
