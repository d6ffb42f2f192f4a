"""Scores in a document: tables that stand between two markers, and are made anew by the scoring."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from smad.gap.check.errors import CheckError
from smad.gap.check.score import mistakes_table
from smad.report.page import Table, markdown_table
from tests.withheld.score_page import beside, confusion, table, trusted
from tests.withheld.scores import Published

# What a document may hold -> the table that goes there, None when these scores have none.
TABLES: dict[str, Callable[[Published], Table | None]] = {
    "scores": table,
    "baselines": beside,
    "confusion": confusion,
    "mistakes": lambda scores: mistakes_table(scores.mistakes),
    "background": trusted,
}


def begin(name: str) -> str:
    """The line above a table."""
    return f"<!-- withheld {name}: made by `python -m tests.withheld score … --readme` -->"


def end(name: str) -> str:
    """The line below it."""
    return f"<!-- end of withheld {name} -->"


def into_document(path: Path, scores: Published) -> None:
    """Replaces every table of `TABLES` that the document has a place for.

    Raises CheckError when the file cannot be read or has no place at all.
    """
    try:
        text = path.read_text()
    except OSError as error:
        raise CheckError(
            f"{path} cannot be read", value=error.strerror, action="check the path"
        ) from error
    found = False
    for name in TABLES:
        head, above, rest = text.partition(begin(name))
        _, below, tail = rest.partition(end(name))
        if above and below:
            found = True
            text = f"{head}{above}\n{_said(name, scores)}{below}{tail}"
    if not found:
        raise CheckError(
            f"{path} has no place for the scores",
            limit="two markers",
            action=f"put the lines {begin('scores')} and {end('scores')} into it",
        )
    path.write_text(text)


def _said(name: str, scores: Published) -> str:
    made = TABLES[name](scores)
    said = markdown_table(made) if made is not None and made.rows else "None.\n"
    if name == "scores":
        said = (
            f"Bank `{scores.bank}`, {scores.answered} of {scores.cases} cases answered.\n\n{said}"
        )
    return said
