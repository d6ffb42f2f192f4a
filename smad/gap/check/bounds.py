"""How much a run file may hold: looked at before it is read whole, in pieces of a megabyte.

A gzip of a few megabytes can unpack to gigabytes, and a bank comes from somebody else.
"""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import BinaryIO, cast

from smad.gap.check.errors import BankError

LONGEST_RUN_S = 3600.0
FASTEST_HZ = 500.0
MOST_ROWS = int(LONGEST_RUN_S * FASTEST_HZ)
"""An hour at the fastest rate: as long as a file of the recorder gets."""

MOST_COLUMNS = 200
MOST_CELLS = 40 * MOST_ROWS
"""A run log has 32 channels."""

MOST_BYTES = 400 * MOST_ROWS
"""Unpacked. All channels of a run log take less than that as text."""

MOST_MANIFEST_BYTES = 16_000_000
_PIECE = 1_000_000


def require_bounded(path: Path) -> None:
    """Raises BankError when the run file unpacks to more than a run can be, ValueError or OSError
    when it cannot be unpacked."""
    if path.suffix == ".parquet":
        _look_at_parquet(path)
    elif path.suffix == ".gz":
        with gzip.open(path) as file:
            _look_at_text(path, cast(BinaryIO, file))
    else:
        with path.open("rb") as plain:
            _look_at_text(path, plain)


def read_bounded(path: Path, most: int) -> bytes:
    """The file's bytes. Raises BankError when there are more than `most`, OSError as `open`."""
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise BankError(
            f"{path} is too large",
            value=f"more than {most} bytes",
            limit=f"{most} bytes",
            action="split the bank",
        )
    return data


def _look_at_text(path: Path, file: BinaryIO) -> None:
    rows = size = 0
    columns = 1
    try:
        while piece := file.read(_PIECE):
            size += len(piece)
            if not rows:
                columns += piece.partition(b"\n")[0].count(b",")
            rows += piece.count(b"\n")
            _require(path, columns=columns, rows=rows, size=size)
    except (EOFError, zlib.error) as error:
        raise ValueError(f"it is cut short or damaged: {error}") from error


def _look_at_parquet(path: Path) -> None:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        data = file.metadata
        size = sum(data.row_group(i).total_byte_size for i in range(data.num_row_groups))
        _require(path, columns=data.num_columns, rows=data.num_rows, size=size)


def _require(path: Path, *, columns: int, rows: int, size: int) -> None:
    for what, value, most in (
        ("columns", columns, MOST_COLUMNS),
        ("rows", rows, MOST_ROWS),
        ("cells", rows * columns, MOST_CELLS),
        ("bytes, unpacked", size, MOST_BYTES),
    ):
        if value > most:
            raise BankError(
                f"run file {path} is longer than a run can be",
                value=f"at least {value} {what}",
                limit=f"{most} {what}",
                action="cut the run, or leave the case out with --only",
            )
