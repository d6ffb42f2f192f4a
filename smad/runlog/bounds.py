"""How much a file of one run may hold, and all runs together: looked at before it is read.

A gzip of a few megabytes can unpack to gigabytes, and a table comes from somebody else. So the
line of names is counted before it is split, a packed text is unpacked in pieces of a megabyte that
are not kept, and a Parquet file tells its rows and columns in its footer.
"""

import gzip
import zlib
from pathlib import Path

from smad.errors import LogImportError, RunLogError, damaged

LONGEST_RUN_S = 3600.0
FASTEST_HZ = 500.0
MOST_ROWS = int(LONGEST_RUN_S * FASTEST_HZ)
"""An hour at the fastest rate: as long as a file of the recorder gets."""

MOST_LOG_ROWS = MOST_ROWS + int(60 * FASTEST_HZ)
"""Of a run log: the recorder begins another file with the first chunk after an hour."""

MOST_LOG_BYTES = 100_000_000
"""Of what a run log holds beside its samples: events, and the link's counters once a second."""

MOST_COLUMNS = 200
MOST_CELLS = 40 * MOST_ROWS
"""A run log has 32 channels."""

MOST_CELLS_TOGETHER = 2 * MOST_CELLS
"""Of all runs that are held at once: 1.2 GB of numbers."""

MOST_BYTES = 400 * MOST_ROWS
"""Unpacked. All channels of a run log take less than that as text."""

MOST_HEAD_CHARACTERS = 100_000
"""Of the line of names and the comments before it."""

MOST_ARRAYS_BYTES = 500_000_000
MOST_ARRAYS = 10_000
"""Of the arrays of one baseline, unpacked, and how many they are."""

_PIECE = 1_000_000
DAMAGED = (OSError, EOFError, zlib.error)
"""What reading a file raises that is absent, cut short or damaged."""


class Together:
    """How many cells are left for runs that are held at once."""

    def __init__(self, most_cells: int = MOST_CELLS_TOGETHER) -> None:
        self._most = most_cells
        self._taken = 0

    def take(self, path: Path, *, rows: int, columns: int) -> None:
        """Count one run in. Raises RunLogError when there are more than may be held."""
        self._taken += rows * columns
        if self._taken > self._most:
            raise RunLogError(
                f"with {path} the runs are more than can be held at once",
                value=f"{self._taken} cells (rows × columns)",
                limit=f"{self._most} cells",
                action="give fewer runs, or shorter ones",
            )


def require_bounded_text(path: Path, columns: int) -> int:
    """Return how many rows a text has at most.

    Raises LogImportError when it unpacks to more than a run can be, or is damaged.
    """
    rows = size = 0
    try:
        with (gzip.open if path.suffix.lower() == ".gz" else open)(path, "rb") as file:
            while piece := file.read(_PIECE):
                size += len(piece)
                rows += max(piece.count(b"\n"), piece.count(b"\r"))
                require_bounded(path, columns=columns, rows=rows, size=size)
    except DAMAGED as error:
        raise damaged(LogImportError, path, error) from error
    return rows + 1


def require_bounded(path: Path, *, columns: int = 0, rows: int = 0, size: int = 0) -> None:
    """Raises LogImportError when these are more than a run can have."""
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
