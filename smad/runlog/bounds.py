"""How much a file of one run may hold: looked at in pieces of a megabyte before it is read whole.

A gzip of a few megabytes can unpack to gigabytes, and a table comes from somebody else.
"""

from __future__ import annotations

import gzip
from pathlib import Path

from smad.errors import LogImportError
from smad.runlog.csv_table import DAMAGED

LONGEST_RUN_S = 3600.0
FASTEST_HZ = 500.0
MOST_ROWS = int(LONGEST_RUN_S * FASTEST_HZ)
"""An hour at the fastest rate: as long as a file of the recorder gets."""

MOST_COLUMNS = 200
MOST_CELLS = 40 * MOST_ROWS
"""A run log has 32 channels."""

MOST_BYTES = 400 * MOST_ROWS
"""Unpacked. All channels of a run log take less than that as text."""

_PIECE = 1_000_000


def require_bounded(path: Path) -> None:
    """Raises LogImportError when a table unpacks to more than a run can be, or is damaged."""
    try:
        if path.suffix == ".parquet":
            _look_at_parquet(path)
        else:
            _look_at_text(path)
    except DAMAGED as error:
        said = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise LogImportError(
            f"cannot read {path}: it is missing, cut short or damaged ({said})",
            action="restore the file",
        ) from error


def _look_at_text(path: Path) -> None:
    rows = size = 0
    columns = 1
    with (gzip.open if path.suffix == ".gz" else open)(path, "rb") as file:
        while piece := file.read(_PIECE):
            size += len(piece)
            if not rows:
                columns += max(piece.partition(b"\n")[0].count(d) for d in (b",", b";", b"\t"))
            rows += piece.count(b"\n")
            _require(path, columns=columns, rows=rows, size=size)


def _look_at_parquet(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            data = file.metadata
            size = sum(data.row_group(i).total_byte_size for i in range(data.num_row_groups))
            _require(path, columns=data.num_columns, rows=data.num_rows, size=size)
    except pa.ArrowException as error:
        raise OSError(str(error)) from error


def _require(path: Path, *, columns: int, rows: int, size: int) -> None:
    for what, value, most in (
        ("columns", columns, MOST_COLUMNS),
        ("rows", rows, MOST_ROWS),
        ("cells", rows * columns, MOST_CELLS),
        ("bytes, unpacked", size, MOST_BYTES),
    ):
        if value > most:
            raise LogImportError(
                f"{path} is longer than a run can be",
                value=f"at least {value} {what}",
                limit=f"{most} {what}",
                action="cut the run, or leave the file out",
            )
