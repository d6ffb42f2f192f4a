"""The record of a bench: one line of JSON for each run or check-up, only ever appended to."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from smad.files import append_lines
from smad.health.errors import HealthError

FILE = "health.jsonl"
FORMAT = 1


class Value(Struct, frozen=True):
    """A quantity with its standard deviation; None: not known, the scatter of rows counts."""

    value: float
    sd: float | None = None


class Row(Struct, frozen=True, kw_only=True):
    """What one run or check-up came to. `cycles` are those of displacement within it.

    Only rows of one `group` are compared: runs of one name, or check-ups.
    `values` are by name with unit, such as `stroke_mm`; `words` are what is no number, such as the
    laws that a check-up found.
    """

    format: int = FORMAT
    unix_s: float
    kind: Literal["run", "checkup", "cycles"]
    source: str
    group: str = ""
    bench: str = ""
    cycles: float = 0.0
    values: Mapping[str, Value] = {}
    words: tuple[str, ...] = ()


def read(path: Path) -> tuple[Row, ...]:
    """Return the rows in the order of their time. A last line that a crash cut is left out.

    Raises HealthError for a line that is damaged, or of a newer version.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise HealthError(
            f"cannot read {path}: {error.strerror}", action="check its permissions"
        ) from None
    rows = []
    for number, line in enumerate(lines, 1):
        if not line:
            continue
        try:
            row = msgspec.json.decode(line, type=Row)
        except msgspec.MsgspecError as error:
            if number == len(lines):
                break
            raise HealthError(
                f"{path}, line {number} is damaged: {error}",
                action="take the line out; the runs are not concerned",
            ) from None
        if row.format > FORMAT:
            raise HealthError(
                f"{path}, line {number} was written by a newer smad",
                value=row.format,
                limit=FORMAT,
                action="use that smad",
            )
        rows.append(row)
    return tuple(sorted(rows, key=lambda row: row.unix_s))


def append(path: Path, rows: Sequence[Row]) -> None:
    """Add rows; they are on the disk when this returns. Raises HealthError."""
    if not rows:
        return
    try:
        append_lines(path, b"".join(msgspec.json.encode(row) + b"\n" for row in rows))
    except OSError as error:
        raise HealthError(
            f"cannot write {path}: {error.strerror}", action="make room, check its permissions"
        ) from None
