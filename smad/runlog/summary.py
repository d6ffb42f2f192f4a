"""What is in a run, in few numbers."""

import numpy as np
from msgspec import Struct

from smad.runlog.reader import Run, recorded
from smad.runlog.schema import CHANNELS, Event


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


def summarise(run: Run) -> RunSummary:
    """The numbers of a run that was read."""
    header = run.header
    usual_s = np.median(np.diff(run.columns["t_s"])) if len(run) > 1 else 0.0
    return RunSummary(
        path=str(run.path),
        name=header.name,
        source=header.source,
        axis=header.axis,
        seed=header.seed,
        started_unix_s=header.started_unix_s,
        rows=len(run),
        duration_s=run.duration_s,
        rate_hz=round(float(1 / usual_s), 3) if usual_s > 0.0 else None,
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
