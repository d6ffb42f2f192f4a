"""Tables that fit the terminal; plain text where the output is none, for a pipe or a file."""

from __future__ import annotations

import io
import shutil
import sys
import textwrap
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Literal

import click

if TYPE_CHECKING:
    from smad.report.page import Table

_GAP = 2
"""Characters between two columns."""
_LONGEST_WORD = 32
"""The name of a run log is one word."""


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
    """Return the table in lines of at most `width` characters; long cells take several lines.

    No word of up to 32 letters is broken. Where the longest words of all columns are too wide,
    columns are left out from the right, and a line below names them. A column without a name, a
    remark, stays.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table as Drawn
    from rich.text import Text

    least = [_longest_word([name, *(row[k] for row in rows)]) for k, name in enumerate(header)]
    shown = list(range(len(header)))
    while len(shown) > 1 and sum(least[k] + _GAP for k in shown) - _GAP > width:
        droppable = [k for k in shown[1:] if header[k]] or shown[1:]
        shown.remove(droppable[-1])
    left_out = [name for k, name in enumerate(header) if k not in shown]
    drawn = Drawn(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for k in shown:
        side: Literal["left", "right"] = "right" if k in numeric else "left"
        drawn.add_column(Text(header[k]), justify=side, overflow="fold", min_width=least[k])
    for row in rows:
        drawn.add_row(*(Text(row[k]) for k in shown))
    out = io.StringIO()
    Console(file=out, width=width, color_system=None, legacy_windows=False).print(drawn)
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    if left_out:
        lines += ["", *textwrap.wrap(f"not shown at this width: {', '.join(left_out)}", width)]
        lines += textwrap.wrap(
            "a wider terminal, or a pipe (… | less -S), shows all columns", width
        )
    return "\n".join(lines) + "\n"


def _longest_word(cells: Sequence[str]) -> int:
    longest = max((len(word) for cell in cells for word in cell.split()), default=0)
    return min(longest, _LONGEST_WORD)
