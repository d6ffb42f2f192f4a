"""What `smad status --watch` shows: lines of text that fit a terminal. Pure."""

import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from firmware_protocol import enums
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from smad.api import Entry, Percentiles, Status
from smad.files import display_path
from smad.runlog.schema import Row
from smad.style.strips import STRIPS, Curve, Strip
from smad.view.state import limiter_of, running_words
from smad.view.terminal.axis_lines import aged, axis_lines
from smad.view.terminal.tables import wrapped

LEAST_COLUMNS, LEAST_ROWS = 60, 20
MOST_HISTORY = 240
BARS = "▁▂▃▄▅▆▇█"
GAP = " "
KEYS = "space: STOP (disarm)   q: quit, the bench goes on"

_NAME, _VALUE, _RANGE = 25, 11, 19

Style = Literal["plain", "title", "good", "warned", "bad", "armed"]


class Line(NamedTuple):
    """One row of the screen."""

    text: str
    style: Style = "plain"


class History:
    """What the sparklines show: the last values of each curve, one a refresh."""

    def __init__(self) -> None:
        self._values: dict[str, deque[float | None]] = {}

    def add(self, row: Row | None) -> None:
        """Take in the readings of one refresh; None: there were none."""
        for strip, curve in CURVES:
            value = None if row is None else getattr(row, curve.column)
            values = self._values.setdefault(curve.column, deque(maxlen=MOST_HISTORY))
            values.append(None if value is None else value * strip.scale)

    def last(self, column: str, count: int) -> list[float | None]:
        """Return the newest `count` values of a column, oldest first."""
        return list(self._values.get(column, ()))[-count:]


CURVES: tuple[tuple[Strip, Curve], ...] = tuple(
    (strip, curve) for strip in STRIPS if not strip.on_demand for curve in strip.curves
)


def sparkline(values: Sequence[float | None]) -> str:
    """Return a bar a value, from the least to the most of them; a space where there is none."""
    present = [value for value in values if value is not None]
    low, high = (min(present), max(present)) if present else (0.0, 0.0)
    step = (high - low) / (len(BARS) - 1)
    return "".join(
        GAP if value is None else BARS[round((value - low) / step) if step else 0]
        for value in values
    )


def screen(
    now: Status | None, history: History, *, columns: int, rows: int, away: str = "", said: str = ""
) -> list[Line]:
    """Return at most `rows` lines of at most `columns` characters.

    State and fault stand first and the keys last, whatever there is between. `away` says why there
    is no status, or that `now` is old; `said` what came of the last key.
    """
    if columns < LEAST_COLUMNS or rows < LEAST_ROWS:
        needed = f"This needs {LEAST_COLUMNS} columns and {LEAST_ROWS} rows."
        return [Line(text[:columns]) for text in (needed, KEYS)][:rows]
    pinned = [Line(f"NOT LIVE: {away}", "bad")] if away else []
    pinned += () if now is None else _pinned(now, columns)
    foot = [Line(said), Line(KEYS, "title")]
    room = rows - len(pinned) - len(foot)
    middle: list[Line] = []
    if now is not None:
        measured: Iterator[Line] = _readings(now, history, columns)
        if now.axes:
            measured = map(Line, axis_lines(now.axes, now.skew or Percentiles()))
        middle = [*measured, *_facts(now)]
        middle += _events(now, room - len(middle))
    middle = middle[:room]
    middle += [Line("")] * (room - len(middle))
    return [Line(line.text[:columns], line.style) for line in (*pinned, *middle, *foot)]


def _pinned(now: Status, columns: int) -> Iterator[Line]:
    motion = now.motion
    state = f"{now.bench}: {'ARMED' if motion.armed else 'not armed'}, board {motion.mode}"
    link = f"{len(now.axes)} axes" if now.axes else f"link {now.link.state}"
    yield Line(f"{state}, {link}", "armed" if motion.armed else "good")
    if motion.fault is None:
        yield Line("no fault")
    else:
        yield Line(f"FAULT {motion.fault.in_words()} (by the {motion.fault.by})", "bad")
        text = FAULT_TEXTS[enums.Fault(motion.fault.number)]
        lines = wrapped(f"{text.cause} {text.remedy} Then smad clear.", columns - 2)
        yield from (Line(f"  {line}", "bad") for line in lines)
    if now.warnings:
        yield Line(f"warnings: {', '.join(now.warnings)}", "warned")
    limiter = limiter_of(now)
    yield Line(running_words(motion) + (f"; limited by {limiter}" if limiter else ""))
    yield Line("")


def _readings(now: Status, history: History, columns: int) -> Iterator[Line]:
    width = columns - _NAME - _VALUE - _RANGE - 3
    old = aged(now.motion).strip(" ()")
    head = f"{'':<{_NAME}} {old or 'now':>{_VALUE}} {'':<{width}} {'least … most':>{_RANGE}}"
    yield Line(head, "bad" if old else "title")
    for strip, curve in CURVES:
        values = history.last(curve.column, width)
        present = [value for value in values if value is not None]
        if not present:
            continue
        name = f"{strip.title.partition(' of ')[0]}, {curve.label}"
        newest = values[-1]
        value = "–" if newest is None else f"{newest:z.{strip.digits}f} {strip.unit}"
        ends = f"{min(present):z.{strip.digits}f} … {max(present):z.{strip.digits}f}"
        yield Line(
            f"{name:<{_NAME}} {value:>{_VALUE}} {sparkline(values):>{width}} {ends:>{_RANGE}}"
        )


def _facts(now: Status) -> Iterator[Line]:
    yield Line("")
    age = now.timing.setpoint_age
    if age.count:
        refused = now.counts.setpoints_refused
        yield Line(
            f"setpoint age p50 {age.p50_us:.0f} µs, p99 {age.p99_us:.0f} µs, {refused} too old",
            "bad" if refused else "plain",
        )
    missed = now.counts.missed
    yield Line(
        f"{now.link.rate_hz} Hz, {missed} of {now.counts.samples} samples missed",
        "bad" if missed else "plain",
    )
    recorder = now.recorder
    if recorder.error:
        yield Line(f"run log: {recorder.error}", "bad")
    elif recorder.recording:
        yield Line(f"recording {display_path(recorder.path)}")
    if now.control.holder:
        yield Line(f"in control: {now.control.holder}, {now.control.left_s:.0f} s left")


def _events(now: Status, room: int) -> list[Line]:
    if room < 2:
        return []
    return [Line(""), *map(_event, now.events[1 - room :])]


def _event(event: Entry) -> Line:
    return Line(f"{time.strftime('%H:%M:%S', time.localtime(event.time_s))}  {event.text}")
