"""Rows of an endurance run, from the statistics that it keeps of every cycle: one for each block.

A block begins from rest. Its cycles are alike, and differ less from each other than blocks do.
"""

import csv
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median

from smad.experiments.endurance.limits import SETTLING, WINDOW
from smad.experiments.endurance.run import CYCLES_FILE, whole_lines
from smad.health.errors import HealthError
from smad.health.record import Row, Value

GAP_S = 1.0
"""Cycles of one block follow each other without a pause."""
_LEFT_OUT = ("number", "t_s", "duration_s")
Cycle = Mapping[str, float]


def rows_of_cycles(folder: Path, sources: Collection[str]) -> Iterator[Row]:
    """Yield the row of each block of `cycles.csv` in a folder that is not known yet.

    It has the medians of the cycles after the first five; a shorter block adds its cycles to the
    next row. Raises HealthError.
    """
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
    done, count = 0, 0
    for block in _blocks(cycles):
        done, count = done + len(block), count + len(block)
        source = f"{CYCLES_FILE} from {block[0]['number']:.0f}"
        settled = block[SETTLING:]
        if len(settled) < WINDOW:
            continue
        if source not in sources:
            yield Row(
                # In their order, all of them before the file was written last.
                unix_s=written_unix_s - (len(cycles) - done) * 1e-3,
                kind="cycles",
                source=source,
                group="endurance cycles",
                cycles=float(count),
                values=dict(_medians(settled)),
            )
        count = 0


def _blocks(cycles: Sequence[Cycle]) -> Iterator[Sequence[Cycle]]:
    begin = 0
    for place in range(1, len(cycles) + 1):
        if place == len(cycles) or _begins_block(cycles[place - 1], cycles[place]):
            yield cycles[begin:place]
            begin = place


def _begins_block(before: Cycle, cycle: Cycle) -> bool:
    return abs(cycle["t_s"] - before["t_s"] - before["duration_s"]) > GAP_S


def _medians(cycles: Sequence[Cycle]) -> Iterator[tuple[str, Value]]:
    for name in cycles[0]:
        finite = [value for cycle in cycles if math.isfinite(value := cycle[name])]
        if finite and name not in _LEFT_OUT:
            yield name, Value(median(finite))
