"""Run logs as panels: the strips of the live page, whole runs, one over the other."""

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC
from pathlib import Path

import numpy as np

from smad.arrays import Array
from smad.errors import RunLogError
from smad.report.page import Page, Section, Table, Text
from smad.report.panels import Mark, Panel, Panels, Trace
from smad.report.planes import planes_of
from smad.runlog.header import date_of
from smad.runlog.reader import Column, Run, recorded
from smad.runlog.schema import Event
from smad.style.strips import STRIPS, Curve, Strip
from smad.units import range_in_words

LETTERS = 26
PENS = 6
"""Colours for runs in the palette; more runs begin anew."""
_MARKED = frozenset({"state", "fault", "warning", "note"})
_DASHES = {"reference": (6, 4), "y": (3, 2)}
"""How the lines of one run differ when the colour says which run it is."""
_MOST_EVENTS = 200
_DIGEST = 12
"""Characters of a digest that are shown."""


@dataclass(frozen=True)
class RunPart:
    """A run on the axis of a page: the part of it that is shown.

    `x` in s from the run's first sample, shape (n,), increasing; `y` the columns, each of that
    shape. `begins` of shape (3, k) are host time, board time and x where the board began to count,
    once and at each restart. `sign` stands for its name where several are shown.
    """

    run: Run
    label: str
    x: Array
    y: Mapping[str, Column]
    begins: Array
    sign: str = ""

    @property
    def name(self) -> str:
        """The label, behind the sign if there is one."""
        return f"{self.sign}: {self.label}" if self.sign else self.label

    @property
    def timed(self) -> Mapping[str, Column]:
        """The columns with the time of the page in place of the board's."""
        return {**self.y, "t_s": self.x}

    def x_of(self, event: Event) -> float | None:
        """Where an event is on the axis; None without a board time."""
        if event.t_s is None:
            return None
        host_s, board_s, x = self.begins
        since_s = event.t_s - board_s
        away_s = np.abs(host_s + since_s - (event.host_time_s or np.nan))
        k = int(np.argmin(np.nan_to_num(away_s, nan=np.inf)))
        return float(x[k] + since_s[k])


def elapsed_s(t_s: Array) -> Array:
    """Return board time, shape (n,), as time that runs on where the board restarted, from 0."""
    steps = np.diff(t_s)
    forward = steps[steps > 0.0]
    usual = float(np.median(forward)) if forward.size else 0.0
    steps = np.where(steps > 0.0, steps, usual)
    return np.concatenate([[0.0], np.cumsum(steps)])[: t_s.size]


def run_parts(
    runs: Sequence[Run], from_s: float | None = None, to_s: float | None = None
) -> list[RunPart]:
    """The runs by the names of their files, in the order in which they are drawn.

    Runs of a bench come after those of a simulation: what was measured lies on top. `from_s` and
    `to_s` cut a part out, in s from each run's first sample. Raises RunLogError where nothing is
    left of a run.
    """
    stems = [run.path.stem for run in runs]
    names = [
        stem if stems.count(stem) == 1 else f"{stem} ({number})"
        for number, stem in enumerate(stems, 1)
    ]
    ends_s = (-math.inf if from_s is None else from_s, math.inf if to_s is None else to_s)
    parts = [_part(run, name, *ends_s) for run, name in zip(runs, names, strict=True)]
    parts.sort(key=lambda drawn: drawn.run.header.source != "sim")
    if len(parts) == 1:
        return parts
    return [replace(drawn, sign=_sign(number)) for number, drawn in enumerate(parts)]


def _part(run: Run, label: str, from_s: float, to_s: float) -> RunPart:
    t_s = run.columns["t_s"].astype(np.float64)
    x = elapsed_s(t_s)
    inside = (x >= from_s) & (x <= to_s)
    if not inside.any():
        raise RunLogError(
            f"{run.path} has no samples between these times",
            value=range_in_words(from_s, to_s, "s"),
            limit=f"0 to {x[-1]:.2f} s" if x.size else "a log with samples",
            action="choose another part, or another log",
        )
    columns = {name: column[inside] for name, column in run.columns.items()}
    at = np.append(0, np.flatnonzero(np.diff(t_s) <= 0.0) + 1)
    begins = np.stack([run.columns["host_time_s"].astype(np.float64), t_s, x])[:, at]
    return RunPart(run, label, x[inside], columns, begins)


def panels_of(runs: Sequence[RunPart], caption: str = "") -> Panels:
    """One panel for each strip of which something was recorded, the runs overlaid.

    Beside them what moves against what, such as displacement against temperature.
    """
    panels = [panel for panel in (_panel(strip, runs) for strip in STRIPS) if panel.traces]
    marks = _marks(runs[0]) if len(runs) == 1 else ()
    planes = planes_of(
        [(drawn.name, _pen(number), drawn.x, drawn.timed) for number, drawn in enumerate(runs)]
    )
    return Panels(panels, caption=caption, marks=marks, planes=planes)


def _panel(strip: Strip, runs: Sequence[RunPart]) -> Panel:
    # References first, of all runs: what was measured is drawn over what was wanted.
    curves = sorted(strip.curves, key=lambda curve: curve.pen != "reference")
    traces = [
        _trace(strip, curve, drawn, _pen(number))
        for curve in curves
        for number, drawn in enumerate(runs)
        if recorded(drawn.y[curve.column]).any()
    ]
    return Panel(strip.title, strip.unit, strip.digits, traces, on_demand=strip.on_demand)


def _trace(strip: Strip, curve: Curve, drawn: RunPart, run_pen: str) -> Trace:
    y = drawn.y[curve.column].astype(np.float64) * strip.scale
    dash = _DASHES.get(curve.pen, ())
    if drawn.sign:
        return Trace(f"{drawn.sign} {curve.label}", drawn.x, y, run_pen, drawn.name, dash)
    return Trace(curve.label, drawn.x, y, curve.pen, dash=() if curve.pen == "y" else dash)


def _pen(number: int) -> str:
    """The colour of a run, where several are shown."""
    return f"run-{number % PENS + 1}"


def _sign(number: int) -> str:
    """A letter that stands for a run where its name is too long."""
    return chr(ord("A") + number) if number < LETTERS else str(number + 1)


def _marks(drawn: RunPart) -> list[Mark]:
    return [
        Mark(x, event.text)
        for event in drawn.run.events
        if event.kind in _MARKED and (x := drawn.x_of(event)) is not None
    ]


def page_of(runs: Sequence[RunPart]) -> Page:
    """A page of runs, overlaid from their first samples on."""
    several = len(runs) > 1
    caption = "Time from the first sample of each run." if several else ""
    sections = [
        Section("Signals", [panels_of(runs, caption)]),
        Section("Runs", [_facts(runs), *_notes(runs)]),
        *(
            Section(f"Events of {drawn.label}" if several else "Events", [_events(drawn)])
            for drawn in runs
            if drawn.run.events
        ),
    ]
    names = ", ".join(drawn.label for drawn in runs)
    if several:
        return Page(f"Runs {names}", sections)
    return Page(f"Run {names}", sections, facts=provenance(runs[0].run))


def provenance(run: Run) -> list[tuple[str, str]]:
    """Return what tells a run from every other: file, digest, date, and what recorded it."""
    header = run.header
    facts = [
        ("run log", run.path.name),
        ("SHA-256", digest(run.path)),
        ("started", f"{date_of(header.started_unix_s, UTC)} UTC" if header.started_unix_s else ""),
        ("recorded by", f"smad {header.versions['smad']}" if "smad" in header.versions else ""),
        ("seed", "" if header.seed is None else str(header.seed)),
    ]
    return [(name, value) for name, value in facts if value]


def digest(path: Path) -> str:
    """Return the first characters of a file's SHA-256; empty where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGEST]
    except OSError:
        return ""


def _facts(runs: Iterable[RunPart]) -> Table:
    return Table(
        ("run", "source", "started (UTC)", "duration (s)", "rows", "gains", "smad", "SHA-256"),
        [
            (
                drawn.name,
                drawn.run.header.source,
                date_of(drawn.run.header.started_unix_s, UTC),
                f"{drawn.run.duration_s:.2f}",
                str(len(drawn.run)),
                ", ".join(f"{name} = {value:g}" for name, value in drawn.run.header.gains.items()),
                drawn.run.header.versions.get("smad", ""),
                digest(drawn.run.path),
            )
            for drawn in runs
        ],
        numeric=frozenset({3, 4}),
    )


def _notes(runs: Iterable[RunPart]) -> list[Text]:
    return [
        Text(f"{drawn.label}: {note}", "note")
        for drawn in runs
        for note in (*drawn.run.header.notes, *drawn.run.notes)
    ]


def _events(drawn: RunPart) -> Table:
    events = drawn.run.events[-_MOST_EVENTS:]
    left_out = len(drawn.run.events) - len(events)
    return Table(
        ("time (s)", "kind", "what"),
        [(_when(drawn.x_of(event)), event.kind, event.text) for event in events],
        f"The last {len(events)}; {left_out} earlier ones are in the log" if left_out else "",
        numeric=frozenset({0}),
    )


def _when(x: float | None) -> str:
    return "" if x is None else f"{x:z.3f}"
