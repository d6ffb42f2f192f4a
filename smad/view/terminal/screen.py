"""What `smad status --watch` shows: lines of text that fit a terminal. Pure."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from smad.api import Percentiles, Status
from smad.runlog.schema import Row
from smad.style.strips import STRIPS, Curve, Strip
from smad.view.terminal.axis_lines import aged, axis_lines
from smad.view.terminal.status_lines import Line, events, folded, head, link, record

LEAST_COLUMNS, LEAST_ROWS = 60, 20
MOST_HISTORY = 240
BARS = "▁▂▃▄▅▆▇█"
GAP = " "
KEYS = "space, Esc: STOP (disarm)   q: quit, the bench goes on"

_NAME, _VALUE, _RANGE = 25, 11, 19


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
        return [Line(text[:columns]) for text in (said, needed, KEYS) if text][:rows]
    pinned = [Line(f"NOT LIVE: {away}", "bad")] if away else []
    if now is not None:
        pinned += [*_folded(head(now), columns), Line("")]
    foot = [Line(said), Line(KEYS, "title")]
    room = rows - len(pinned) - len(foot)
    middle: list[Line] = []
    if now is not None:
        if now.axes:
            middle = [Line(text) for text in axis_lines(now.axes, now.skew or Percentiles())]
        else:
            middle = [*_readings(now, history, columns), Line(""), *_folded(link(now), columns)]
        middle += [*_folded(record(now), columns), Line("")]
        middle += events(now, room - len(middle))
    middle = middle[:room]
    middle += [Line("")] * (room - len(middle))
    return [Line(line.text[:columns], line.style) for line in (*pinned, *middle, *foot)]


def _folded(lines: Iterable[Line], columns: int) -> Iterator[Line]:
    for line in lines:
        yield from (Line(text, line.style) for text in folded(line.text, columns).splitlines())


def _readings(now: Status, history: History, columns: int) -> Iterator[Line]:
    width = columns - _NAME - _VALUE - _RANGE - 3
    old = aged(now.motion).strip(" ()")
    over = f"{'':<{_NAME}} {old or 'now':>{_VALUE}} {'':<{width}} {'least … most':>{_RANGE}}"
    yield Line(over, "bad" if old else "title")
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
