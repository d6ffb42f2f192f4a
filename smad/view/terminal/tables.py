"""Tables within the terminal's width; in a pipe or a file, all columns in full."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Collection, Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

import click

from smad.units import NO_BREAK, unparted

if TYPE_CHECKING:
    from smad.report.page import Table

_GAP = 2
"""Characters between two columns."""
_LONGEST_WORD = 32
"""The name of a run log is one word."""


def print_table(table: Table) -> None:
    """Print a table of a page, as `print_columns` does."""
    print_columns(table.header, table.rows, table.numeric)


def print_columns(
    header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Collection[int] = ()
) -> None:
    """Print rows below a header; columns whose number is in `numeric` are right-aligned."""
    if sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        click.echo(fitted(header, rows, numeric, width), nl=False)
    else:
        click.echo(in_full(header, rows, numeric), nl=False)


def in_full(header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Collection[int]) -> str:
    """Return the table in lines as long as its cells ask for."""
    widths = {k: max(map(len, column)) for k, column in enumerate(zip(header, *rows, strict=True))}
    return "".join(f"{_line(row, widths, numeric)}\n" for row in (header, *rows))


def fitted(
    header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Collection[int], width: int
) -> str:
    """Return the table in lines of at most `width` characters; long cells take several lines.

    No word of up to 32 letters is broken. Where the longest words of all columns are too wide,
    columns are left out from the right, and a line below names them. A column without a name, a
    remark, stays.
    """
    least = [_longest_word([name, *(row[k] for row in rows)]) for k, name in enumerate(header)]
    columns = [k for k, name in enumerate(header) if name or any(row[k] for row in rows)]
    while len(columns) > 1 and sum(least[k] + _GAP for k in columns) - _GAP > width:
        droppable = [k for k in columns[1:] if header[k]] or columns[1:]
        columns.remove(droppable[-1])
    left_out = [name for k, name in enumerate(header) if name and k not in columns]
    widths = {k: max(map(len, (header[k], *(row[k] for row in rows)))) for k in columns}
    while sum(widths.values()) + _GAP * (len(columns) - 1) > width:
        widest = max(columns, key=lambda k: (widths[k] > least[k], widths[k]))
        widths[widest] -= 1
    lines = [line for row in (header, *rows) for line in _folded(row, widths, numeric)]
    head = len(_folded(header, widths, numeric))
    lines.insert(head, "─" * (sum(widths.values()) + _GAP * (len(columns) - 1)))
    if left_out:
        lines += ["", *wrapped(f"not shown at this width: {', '.join(left_out)}", width)]
        lines += wrapped("a wider terminal, or a pipe (… | less -S), shows all columns", width)
    return "\n".join(lines) + "\n"


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Return text in lines of at most `width`, those after the first indented.

    A value stays with its unit.
    """
    lines = textwrap.wrap(unparted(text), width, subsequent_indent=indent)
    return [line.replace(NO_BREAK, " ") for line in lines]


def _folded(row: Sequence[str], widths: Mapping[int, int], numeric: Collection[int]) -> list[str]:
    """Return the lines of one row, each cell folded to the width of its column."""
    cells = {k: wrapped(row[k], width) or [""] for k, width in widths.items()}
    lines = zip_longest(*cells.values(), fillvalue="")
    return [_line(dict(zip(cells, line, strict=True)), widths, numeric) for line in lines]


def _line(
    cells: Mapping[int, str] | Sequence[str], widths: Mapping[int, int], numeric: Collection[int]
) -> str:
    parts = [
        cells[k].rjust(width) if k in numeric else cells[k].ljust(width)
        for k, width in widths.items()
    ]
    return (" " * _GAP).join(parts).rstrip()


def _longest_word(cells: Sequence[str]) -> int:
    longest = max((len(word) for cell in cells for word in unparted(cell).split(" ")), default=0)
    return min(longest, _LONGEST_WORD)
