"""Points of a trajectory in a CSV file, for whoever moves the bench: a few columns, no gaps.

Read with Python's own csv, so that `smad move` needs neither numpy nor Arrow.
"""

import csv
import io
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from smad.config.axes import millimetres
from smad.control.commands import Samples
from smad.counted import counted
from smad.errors import CommandError
from smad.files import read_whole

TIME = "t_s"
DISPLACEMENT = "displacement_mm"
ANGLE = "angle_deg"


def read_points(path: Path, columns: Sequence[Sequence[str]]) -> dict[str, list[float]]:
    """The times, shifted to begin at 0, and one column of each group of names, the first there is.

    Raises CommandError, naming line and column, for fewer than two points, times that do not rise,
    and what is no number.
    """
    try:
        file = io.StringIO(read_whole(path).decode("utf-8-sig"), newline="")
        rows = csv.DictReader(file, skipinitialspace=True)
        header = rows.fieldnames or ()
        names = [next((n for n in group if n in header), "") for group in ((TIME,), *columns)]
        if not all(names):
            lacking = " or ".join([(TIME,), *columns][names.index("")])
            raise CommandError(
                f"{path}: a column is missing: {lacking}",
                value=", ".join(header) or "an empty file",
                limit=", ".join([TIME, *(" or ".join(group) for group in columns)]),
                action="name the columns so, in the first line",
            )
        points = [[_number(path, rows.line_num, n, row[n]) for n in names] for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise CommandError(f"cannot read {path}: {reason}", action="give a CSV file") from error
    if len(points) < 2 or any(b[0] <= a[0] for a, b in pairwise(points)):
        raise CommandError(
            f"{path}: the times do not rise from point to point",
            value=counted(len(points), "point"),
            limit="at least 2, each later than the one before",
            action="sort the points",
        )
    by_name = dict(zip(names, map(list, zip(*points, strict=True)), strict=True))
    start_s = by_name[TIME][0]
    return by_name | {TIME: [t - start_s for t in by_name[TIME]]}


def read_samples(path: Path) -> Samples:
    """Return the points of a CSV file with displacements, or angles of the segment.

    Raises CommandError, as `read_points` does.
    """
    columns = read_points(path, [(DISPLACEMENT, ANGLE)])
    places = columns.get(DISPLACEMENT) or [millimetres(angle) for angle in columns[ANGLE]]
    return Samples(t_s=tuple(columns[TIME]), displacement_mm=tuple(places))


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CommandError(
            f"{path}, line {line}: {column} is not a number", value=text, action="correct the line"
        )
    return value
