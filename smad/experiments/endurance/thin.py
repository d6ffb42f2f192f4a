"""A run log with every n-th cycle in full and nothing of the rest."""

import os
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from smad.files import replacing
from smad.runlog.reader import Run, read_run, recorded
from smad.runlog.schema import Event, Record, Row
from smad.runlog.writer import write_run


def thin(path: Path, stretches: Sequence[tuple[int, int]], note: str) -> int:
    """Replace the log by one with these samples (first, last excluded) and all of its events.

    Returns how many samples it has. The new log is on the disk whole before the old one goes.
    Raises RunLogError.
    """
    run = read_run(path)
    chosen = np.zeros(len(run), bool)
    for begin, end in stretches:
        chosen[begin:end] = True
    rows = [_row(run, int(place)) for place in np.flatnonzero(chosen)]
    records: list[Record] = sorted([*rows, *run.events], key=lambda record: record.t_s or 0.0)
    records.append(Event(t_s=run.columns["t_s"][-1], kind="note", text=note))
    header = msgspec.structs.replace(run.header, notes=[*run.header.notes, note])
    with replacing(path) as draft:
        draft.unlink(missing_ok=True)
        write_run(draft, header, records)
        _to_disk(draft)
    _to_disk(path.parent)
    return len(rows)


def _row(run: Run, place: int) -> Row:
    values = {name: column[place] for name, column in run.columns.items()}
    return Row(**{name: value.item() for name, value in values.items() if recorded(value)})


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
