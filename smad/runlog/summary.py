"""What is in a run, and what is in a folder of runs, in few numbers."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from mcap import records
from msgspec import Struct

from smad.errors import RunLogError
from smad.runlog import open_logs
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.mcap_file import CHANNEL_IDS, ROWS_DURATION, ROWS_METADATA_NAME
from smad.runlog.paths import SUFFIX
from smad.runlog.reader import Run, recorded
from smad.runlog.scan import Damage, NotMcapError, scan
from smad.runlog.schema import CHANNELS, Event, Row
from smad.runlog.statistics import read_ending


class ChannelSummary(Struct, frozen=True, kw_only=True):
    """One channel over a run: rows with a value, and the range of the values in `unit`."""

    name: str
    unit: str
    recorded: int
    least: float
    mean: float
    most: float


class RunSummary(Struct, frozen=True, kw_only=True):
    """A run at a glance. `rate_hz` is what the rows say: 1 / median step of board time."""

    path: str
    name: str
    source: str
    axis: int
    seed: int | None
    started_unix_s: float
    rows: int
    duration_s: float
    rate_hz: float | None
    being_written: bool
    cut_short: bool
    dropped: int
    notes: list[str]
    gains: dict[str, float]
    versions: dict[str, str]
    parameter_sha256: str
    channels: list[ChannelSummary]
    missing: list[str]
    events: list[Event]


class Overview(Struct, frozen=True, kw_only=True):
    """One line of a list of runs. `rows` and `duration_s` are None when it has no end.

    `duration_s` is board time, and None in a log whose writer did not note it.
    """

    path: str
    size_bytes: int
    name: str = ""
    source: str = ""
    started_unix_s: float = 0.0
    rows: int | None = None
    duration_s: float | None = None
    problem: str = ""


def summarise(run: Run) -> RunSummary:
    """The numbers of a run that was read."""
    header = run.header
    steps_s = np.diff(run.columns["t_s"])
    return RunSummary(
        path=str(run.path),
        name=header.name,
        source=header.source,
        axis=header.axis,
        seed=header.seed,
        started_unix_s=header.started_unix_s,
        rows=len(run),
        duration_s=run.duration_s,
        rate_hz=round(float(1 / np.median(steps_s)), 3) if len(steps_s) and steps_s.any() else None,
        being_written=run.being_written,
        cut_short=run.cut_short,
        dropped=run.dropped,
        notes=run.notes,
        gains=header.gains,
        versions=header.versions,
        parameter_sha256=header.parameter_sha256,
        channels=[_channel(name, run) for name in CHANNELS if name not in run.missing],
        missing=run.missing,
        events=run.events,
    )


def _channel(name: str, run: Run) -> ChannelSummary:
    column = run.columns[name]
    values = column[recorded(column)]
    return ChannelSummary(
        name=name,
        unit=CHANNELS[name].unit,
        recorded=len(values),
        least=float(values.min()),
        mean=float(values.mean()),
        most=float(values.max()),
    )


def list_runs(folder: str | Path) -> list[Overview]:
    """The run logs of a folder by name, which is by time. Reads only head and end of each file.

    Raises RunLogError when the folder cannot be read.
    """
    folder = Path(folder)
    try:
        paths = sorted(path for path in folder.iterdir() if path.suffix == SUFFIX)
    except OSError as error:
        raise RunLogError(
            f"cannot read folder {folder}: {error.strerror}", action="name another with --folder"
        ) from error
    return [_overview(path) for path in paths]


def _overview(path: Path) -> Overview:
    try:
        open_still = open_logs.being_written(path)
        size_bytes = path.stat().st_size
        header = _header(path, size_bytes)
        ending = read_ending(path, ROWS_METADATA_NAME)
    except OSError as error:
        return Overview(path=str(path), size_bytes=0, problem=error.strerror or "unreadable")
    except NotMcapError:
        return Overview(path=str(path), size_bytes=size_bytes, problem="no MCAP file")
    rows = duration_s = None
    problem = "being written" if open_still else "cut short"
    if ending is not None:
        rows = ending.statistics.channel_message_counts.get(CHANNEL_IDS[Row], 0)
        problem = ""
        duration_s = _seconds(ending.metadata.get(ROWS_DURATION, ""))
    return Overview(
        path=str(path),
        size_bytes=size_bytes,
        name=header.name,
        source=header.source,
        started_unix_s=header.started_unix_s,
        rows=rows,
        duration_s=duration_s,
        problem=problem,
    )


def _seconds(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _header(path: Path, size_bytes: int) -> RunHeader:
    with path.open("rb") as file:
        for item in scan(file, size_bytes, Damage()):
            if isinstance(item, records.Metadata) and item.name == METADATA_NAME:
                return RunHeader.from_metadata(item.metadata)
            if isinstance(item, tuple):
                break
    return RunHeader()
