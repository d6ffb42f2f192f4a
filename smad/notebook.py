"""What Jupyter shows of our records: tables in HTML, everything in them escaped. Pure."""

from collections.abc import Iterable, Sequence
from html import escape

Cells = Sequence[str]


def facts(title: str, rows: Iterable[tuple[str, str]], note: str = "") -> str:
    """Return names and values under a title; rows without a value are left out."""
    return table(title, (), [row for row in rows if row[1]], note)


def table(title: str, header: Cells, rows: Iterable[Cells], note: str = "") -> str:
    """Return a table under a title, and a paragraph below it."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>"
        + "".join(f'<td style="text-align:left">{escape(cell)}</td>' for cell in row)
        + "</tr>"
        for row in rows
    )
    return (
        f"<strong>{escape(title)}</strong><table>"
        + (f"<thead><tr>{head}</tr></thead>" if head else "")
        + f"<tbody>{body}</tbody></table>"
        + (f"<p>{escape(note)}</p>" if note else "")
    )
