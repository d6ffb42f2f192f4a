"""Rows of an endurance run, from the statistics that it keeps of every cycle."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterator
from pathlib import Path
from statistics import median

from smad.experiments.endurance.run import CYCLES_FILE, whole_lines
from smad.health.errors import HealthError
from smad.health.record import Row, Value

CYCLES_A_ROW = 50
"""A row has the medians of so many cycles; those of the last, incomplete row come later."""
_LEFT_OUT = ("number", "t_s", "duration_s")


def rows_of_cycles(folder: Path, known: Collection[str]) -> Iterator[Row]:
    """Yield the rows of `cycles.csv` in a folder that are not known yet. Raises HealthError."""
    path = folder / CYCLES_FILE
    if not path.exists():
        return
    try:
        rows = csv.DictReader(whole_lines(path))
        cycles = [{name: float(text) for name, text in row.items()} for row in rows]
        written_unix_s = path.stat().st_mtime
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise HealthError(
            f"{path} cannot be read: {error}", action="take the damaged line out"
        ) from None
    for begin in range(0, len(cycles) - CYCLES_A_ROW + 1, CYCLES_A_ROW):
        part = cycles[begin : begin + CYCLES_A_ROW]
        source = f"{CYCLES_FILE} {part[0]['number']:.0f} to {part[-1]['number']:.0f}"
        if source in known:
            continue
        values = {
            name: Value(median(finite))
            for name in part[0]
            if name not in _LEFT_OUT
            and (finite := [v for cycle in part if math.isfinite(v := cycle[name])])
        }
        # In their order, all of them before the file was written last.
        behind = (len(cycles) - begin) * 1e-3
        yield Row(
            unix_s=written_unix_s - behind,
            kind="cycles",
            source=source,
            group="endurance cycles",
            cycles=float(CYCLES_A_ROW),
            values=values,
        )
