"""Tables of a report as text, for what measures and compares: benchmarks, evaluation, campaigns."""

from collections.abc import Sequence

from smad.report.page import Table


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
