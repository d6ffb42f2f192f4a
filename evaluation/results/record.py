"""A measurement that is kept: its tables and what they are of, a JSON file each."""

from __future__ import annotations

import datetime
from pathlib import Path

import msgspec

from evaluation.checkout import commit
from evaluation.errors import WithheldError
from smad.report.page import Table

FOLDER = Path(__file__).parent


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """One measurement: the command that printed it, and its tables by heading.

    `date` is ISO 8601, `commit` that of the code that was measured.
    """

    title: str
    date: str
    commit: str
    command: str
    notes: list[str]
    tables: dict[str, Table]


def keep(path: Path, tables: dict[str, Table], *, title: str, command: str, note: str) -> None:
    """Write tables of today. Raises WithheldError when the file cannot be written."""
    result = Result(
        title=title or path.stem,
        date=datetime.datetime.now(datetime.UTC).date().isoformat(),
        commit=commit(),
        command=command,
        notes=[note] if note else [],
        tables=tables,
    )
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=1) + b"\n")
    except OSError as error:
        raise WithheldError(
            f"{path} cannot be written ({error.strerror}): choose another"
        ) from None


def all_results(folder: Path = FOLDER) -> list[Result]:
    """Every kept result, the newest first. Raises WithheldError for a file that is none."""
    results = []
    for path in folder.glob("*.json"):
        try:
            results.append(msgspec.json.decode(path.read_bytes(), type=Result))
        except msgspec.DecodeError as error:
            raise WithheldError(f"{path} is no result ({error}): measure again") from None
    return sorted(results, key=lambda result: (result.date, result.title), reverse=True)
