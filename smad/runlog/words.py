"""Run logs in words, for whoever prints them: header, rows and events. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from smad.runlog.header import date_of
from smad.runlog.overview import Overview

if TYPE_CHECKING:
    # A list of runs needs no numpy.
    from smad.runlog.summary import RunSummary

_EVENTS_SHOWN = 10

OVERVIEW = ("file", "name", "source", "started", "rows", "duration", "size", "")
CHANNELS = ("channel", "unit", "rows", "least", "mean", "most")


def overview_row(run: Overview) -> tuple[str, ...]:
    """The cells of a run in a list, as `OVERVIEW` names them."""
    return (
        Path(run.path).name,
        run.name,
        run.source,
        date_of(run.started_unix_s),
        "" if run.rows is None else str(run.rows),
        "" if run.duration_s is None else f"{run.duration_s:.1f} s",
        f"{run.size_bytes / 1e6:.2f} MB",
        run.problem,
    )


def channel_rows(run: RunSummary) -> list[tuple[str, ...]]:
    """The cells of each channel, as `CHANNELS` names them."""
    return [
        (c.name, c.unit, str(c.recorded), f"{c.least:g}", f"{c.mean:g}", f"{c.most:g}")
        for c in run.channels
    ]


def header_lines(run: RunSummary) -> Iterator[str]:
    """What a run is, and its notes."""
    rate = "" if run.rate_hz is None else f" at {run.rate_hz:g} Hz"
    facts = {
        "file": run.path,
        "name": run.name,
        "source": run.source,
        "started": date_of(run.started_unix_s),
        "rows": f"{run.rows} in {run.duration_s:.2f} s{rate}",
        "axis": str(run.axis),
        "seed": "" if run.seed is None else str(run.seed),
        "gains": ", ".join(f"{name} = {value:g}" for name, value in run.gains.items()),
        "parameters": run.parameter_sha256[:12],
    }
    yield from (f"{name:<11}{value}" for name, value in facts.items() if value)
    yield from (f"note: {note}" for note in run.notes)


def ending_lines(run: RunSummary) -> Iterator[str]:
    """What was not recorded, and the last events."""
    if run.missing:
        yield f"\nnot recorded: {', '.join(run.missing)}"
    if run.events:
        yield f"\nevents ({len(run.events)}, the last {_EVENTS_SHOWN}):"
    for event in run.events[-_EVENTS_SHOWN:]:
        when = "" if event.t_s is None else f"{event.t_s:.3f} s"
        yield f"{when:>12}  {event.kind:<8} {event.text}"
