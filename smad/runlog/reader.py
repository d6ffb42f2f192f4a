"""Reading a run log back, whole or cut, as arrays."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np
from mcap import records
from msgspec import Struct
from numpy.typing import NDArray

from smad import notebook
from smad.counted import counted
from smad.errors import RunLogError
from smad.extras import part
from smad.progress import Share, silent
from smad.runlog import open_logs
from smad.runlog.bounds import MOST_LOG_BYTES, MOST_LOG_ROWS
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.holes import HOLES, RECOVERED_METADATA_NAME
from smad.runlog.scan import Damage, NotMcapError, scan
from smad.runlog.schema import (
    CHANNELS,
    CUT,
    EVENT_TOPIC,
    LEGENDS,
    LINK_TOPIC,
    MISSING_INTEGER,
    ROW_TOPIC,
    Event,
    LinkSample,
    Row,
    row_topic,
)
from smad.runlog.writer import END_METADATA_NAME

if TYPE_CHECKING:
    import pandas

_ROWS_A_BATCH = 20_000
_BYTES_A_BATCH = 20_000_000
_ITEMS_A_REPORT = 10_000
Column = NDArray[np.float64] | NDArray[np.int64]


@dataclass(frozen=True)
class Run:
    """A run that was read back.

    `columns` holds every channel of the schema, all of one length n: float64 with NaN, or int64
    with -1, where nothing was recorded. `axis` is its name if the bench has several, and `unix_s`,
    shape (n,), the times of its samples on the clock that all axes share. `being_written`: a
    program still writes the log. `cut_short`: none does, and recording did not end properly (a
    crash, a full disk). `notes` says in words what is wrong or missing; empty for a complete log.
    """

    path: Path
    header: RunHeader
    columns: dict[str, Column]
    events: list[Event] = field(default_factory=list)
    link: list[LinkSample] = field(default_factory=list)
    being_written: bool = False
    cut_short: bool = False
    dropped: int = 0
    damaged: int = 0
    notes: list[str] = field(default_factory=list)
    axis: str = ""
    unix_s: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def __len__(self) -> int:
        return len(self.columns["t_s"])

    @property
    def duration_s(self) -> float:
        """Board time that the rows cover; a restart of the board begins it anew."""
        return float(np.maximum(np.diff(self.columns["t_s"]), 0.0).sum())

    @property
    def cut_by(self) -> str:
        """What cut the run, "stopped by …"; empty for one that came to its end."""
        texts = (event.text for event in self.events)
        return next((text.removeprefix(CUT) for text in texts if text.startswith(CUT)), "")

    @property
    def missing(self) -> list[str]:
        """Channels of which nothing was recorded."""
        return [name for name, column in self.columns.items() if not recorded(column).any()]

    def to_pandas(self) -> pandas.DataFrame:
        """The channels that were recorded as a DataFrame of n rows, by board time `t_s`.

        Whole numbers are nullable integers; `mode` and `limiter` are words. Units are in
        `frame.attrs["units"]`. Raises MissingPartError without pandas.
        """
        pd = part("pandas")
        columns = {n: c for n, c in self.columns.items() if recorded(c).any()}
        frame: pandas.DataFrame = pd.DataFrame({n: _series(pd, n, c) for n, c in columns.items()})
        frame.attrs["units"] = {name: CHANNELS[name].unit for name in columns}
        return frame.set_index("t_s") if "t_s" in columns else frame

    def _repr_html_(self) -> str:
        rows = [
            (name, CHANNELS[name].unit, f"{v.min():g}", f"{v.mean():g}", f"{v.max():g}")
            for name, column in self.columns.items()
            if (v := column[recorded(column)]).size
        ]
        rows_s = f"{counted(len(self), 'row')}, {self.duration_s:.2f} s"
        title = f"{self.path.name}: {rows_s}, {self.header.source}"
        header = ("channel", "unit", "least", "mean", "most")
        return notebook.table(title, header, rows, "; ".join(self.notes))


def board_time_s(run: Run, event: Event) -> float | None:
    """Return the board time of an event, from when it came where the log has several boards.

    None where that is not known either.
    """
    host_s = run.columns["host_time_s"]
    if event.t_s is not None or event.host_time_s is None or not recorded(host_s).any():
        return event.t_s
    row = int(np.nanargmin(np.abs(host_s - event.host_time_s)))
    return float(run.columns["t_s"][row] + event.host_time_s - host_s[row])


def row_near(run: Run, event: Event, at_s: float) -> int:
    """Return the row that is nearest to board time `at_s` of an event.

    Of a board that restarted, in the stretch in which the event came by the computer's clock.
    """
    t_s, host_s = run.columns["t_s"], run.columns["host_time_s"]
    begins = np.flatnonzero(np.diff(t_s) < 0) + 1
    came_s = -np.inf if event.host_time_s is None else event.host_time_s
    edges = [0, *begins.tolist(), len(t_s)]
    stretch = int(np.searchsorted(host_s[begins], came_s, side="right"))
    begin, end = edges[stretch : stretch + 2]
    return begin + int(np.argmin(np.abs(t_s[begin:end] - at_s)))


def recorded(column: Column) -> NDArray[np.bool_]:
    """Where a column holds a value, shape (n,)."""
    if column.dtype.kind == "f":
        return ~np.isnan(column)
    return np.asarray(column != MISSING_INTEGER)


def read_axes(path: str | Path, *, progress: Share = silent) -> dict[str, Run]:
    """Every axis in the file at `path` by its name; of a bench of one axis, that under "".

    Raises RunLogError as `read_run` does.
    """
    names = _read(Path(path), "", progress).header.axes or ("",)
    return {name: read_run(path, axis=name, progress=progress) for name in names}


def read_run(path: str | Path, *, axis: str = "", progress: Share = silent) -> Run:
    """Read the run in the file at `path` as far as possible; with several axes, that of `axis`.

    A log of this axis alone is accepted, too. `progress` is called now and then with the share of
    the file that was read, 0 to 1.
    Raises RunLogError if the file cannot be opened, is no MCAP file, is no run log, holds more
    than the recorder writes into a log, or holds several axes but not `axis`.
    """
    run = _read(Path(path), axis, progress)
    if axis and not run.header.axes and run.header.extra.get("axis") == axis:
        return _read(Path(path), "", progress)
    if not axis and len(run.header.axes) == 1:
        return _read(Path(path), run.header.axes[0], progress)
    if axis not in (run.header.axes or ("",)):
        raise RunLogError(
            f"{path} is the log of {'several axes' if run.header.axes else 'a bench of one axis'}",
            value=axis or "no axis named",
            limit=", ".join(run.header.axes) or "no name",
            action="name one of these (--axis), or make a log of each: smad log split"
            if run.header.axes
            else "leave --axis out",
        )
    return run


def _read(path: Path, axis: str, progress: Share) -> Run:
    damage = Damage()
    builder = _RunBuilder(path, axis)
    try:
        damage.being_written = open_logs.being_written(path)
        size = path.stat().st_size
        with path.open("rb") as file:
            for count, item in enumerate(scan(file, size, damage)):
                builder.add(item)
                if count % _ITEMS_A_REPORT == 0:
                    progress(file.tell() / size)
    except OSError as error:
        raise RunLogError(
            f"cannot read {path}: {error.strerror}", action="check the path"
        ) from error
    except NotMcapError as error:
        raise RunLogError(
            f"{path} is not a run log: {error.why}",
            value=f"{size} bytes",
            action=error.action or "use `smad log import` for logs of other programs"
            if size
            else "nothing was recorded into it; leave it out",
        ) from None
    if not builder.has_rows_channel:
        raise RunLogError(
            f"{path} is not a run log: it has no channel {ROW_TOPIC}",
            value=f"{size} bytes",
            action="it was cut before the first sample, so nothing can be recovered; or another "
            "program wrote it",
        )
    run = builder.finish(damage)
    progress(1.0)
    return run


T = TypeVar("T", bound=Struct)


def _decoded(record: type[T], messages: Sequence[tuple[int, bytes]]) -> list[tuple[int, T]]:
    """JSON bodies as records, with the times of their messages in ns; fewer where some do not fit.

    Each by itself: parts of torn bodies must never add up to a record that nobody wrote.
    """
    decode, decoded = msgspec.json.Decoder(record).decode, []
    for time_ns, body in messages:
        with contextlib.suppress(msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            decoded.append((time_ns, decode(body)))
    return decoded


class _RunBuilder:
    """Collects what a scan yields, and turns rows into columns batch by batch.

    A chunk of a few kilobytes can unpack to 256 MiB, so rows and bytes are counted as they come.
    """

    def __init__(self, path: Path, axis: str) -> None:
        self._path = path
        self._axis = axis
        self._count = 0
        self._waiting_bytes = 0
        self._other_bytes = 0
        self._topics: dict[int, str] = {}
        self._metadata: dict[str, dict[str, str]] = {}
        self._rows: list[tuple[int, bytes]] = []
        self._events: list[tuple[int, bytes]] = []
        self._link: list[tuple[int, bytes]] = []
        self._times_ns: list[int] = []
        self._inboxes = {
            row_topic(axis): self._rows,
            EVENT_TOPIC: self._events,
            LINK_TOPIC: self._link,
        }
        self._inbox_of: dict[int, list[tuple[int, bytes]]] = {}
        self._refused = 0
        self._batches: list[dict[str, Column]] = []

    @property
    def has_rows_channel(self) -> bool:
        return ROW_TOPIC in self._topics.values()

    def add(self, item: object) -> None:
        if isinstance(item, tuple):
            inbox = self._inbox_of.get(item[0])
            if inbox is not None:
                self._keep(inbox, item[1], item[2])
        elif isinstance(item, records.Channel):
            self._topics[item.id] = item.topic
            if item.topic in self._inboxes:
                self._inbox_of[item.id] = self._inboxes[item.topic]
        elif isinstance(item, records.Metadata):
            self._metadata[item.name] = item.metadata

    def _keep(self, inbox: list[tuple[int, bytes]], time_ns: int, body: bytes) -> None:
        inbox.append((time_ns, body))
        if inbox is not self._rows:
            self._other_bytes += sys.getsizeof(body)
            self._require("bytes beside the samples", self._other_bytes, MOST_LOG_BYTES)
            return
        self._count += 1
        self._waiting_bytes += len(body)
        self._require("samples", self._count, MOST_LOG_ROWS)
        if len(inbox) >= _ROWS_A_BATCH or self._waiting_bytes >= _BYTES_A_BATCH:
            self._decode_rows()

    def _require(self, what: str, value: int, most: int) -> None:
        if value > most:
            raise RunLogError(
                f"{self._path} is longer than a run log can be",
                value=f"more than {most} {what}",
                limit=f"{most} {what}",
                action="leave it out; a recorder begins a new file before",
            )

    def finish(self, damage: Damage) -> Run:
        self._decode_rows()
        events, link = _decoded(Event, self._events), _decoded(LinkSample, self._link)
        notes = list(damage.notes)
        if METADATA_NAME not in self._metadata:
            notes.append("the header is missing")
        ended = self._metadata.get(END_METADATA_NAME, {}).get("dropped", "0")
        dropped = int(ended) if ended.isdecimal() and len(ended) < 19 else 0
        if dropped:
            notes.append(f"{counted(dropped, 'row')} dropped while recording")
        run = Run(
            path=self._path,
            header=RunHeader.from_metadata(self._metadata.get(METADATA_NAME, {})),
            columns=self._columns(),
            events=[event for _, event in events],
            link=[sample for _, sample in link],
            being_written=damage.being_written and not damage.ended_in_order,
            cut_short=not (damage.ended_in_order or damage.being_written),
            dropped=dropped,
            damaged=damage.lost_messages,
            notes=notes,
            axis=self._axis,
            unix_s=np.array(self._times_ns, np.float64) * 1e-9,
        )
        recovered = self._metadata.get(RECOVERED_METADATA_NAME, {}).get(HOLES, "")
        notes += [f"{line}: lost before it was recovered" for line in recovered.splitlines()]
        refused = self._refused + len(self._events) - len(events) + len(self._link) - len(link)
        if refused:
            notes.append(f"{counted(refused, 'message')} left out: not of the schema")
        if damage.lost_messages:
            notes.append(f"{counted(damage.lost_messages, 'message')} lost in damaged chunks")
        if len(run) > 1 and not (np.diff(run.columns["t_s"]) > 0).all():
            notes.append("board time does not always increase: the board restarted")
        return run

    def _decode_rows(self) -> None:
        if self._rows:
            timed = _decoded(Row, self._rows)
            self._refused += len(self._rows) - len(timed)
            self._batches.append(columns_of([row for _, row in timed]))
            self._times_ns += [time_ns for time_ns, _ in timed if self._axis]
            self._rows.clear()
            self._waiting_bytes = 0

    def _columns(self) -> dict[str, Column]:
        if not self._batches:
            return columns_of([])
        batches = self._batches
        return {name: np.concatenate([b.pop(name) for b in batches]) for name in CHANNELS}


def columns_of(rows: list[Row]) -> dict[str, Column]:
    """The rows as columns, every channel of the schema, each of shape (n,)."""
    return {name: _column(name, rows) for name in CHANNELS}


def _column(name: str, rows: list[Row]) -> Column:
    get = attrgetter(name)
    if CHANNELS[name].kind == "float":
        # numpy reads None as NaN.
        return np.array([get(row) for row in rows], dtype=np.float64)
    values = [_whole(get(row)) for row in rows]
    return np.array(values, dtype=np.int64)


def _whole(value: int | None) -> int:
    # A log of another program may hold more than 64 bits; that is no value of ours.
    return MISSING_INTEGER if value is None or not 0 <= value < 2**63 else value


def _series(pd: Any, name: str, column: Column) -> Any:
    """A column as pandas has it, by its kind."""
    series = pd.Series(column)
    if CHANNELS[name].kind == "float":
        return series
    series = series.astype("Int64").where(recorded(column))
    legend = LEGENDS.get(name)
    if legend is None:
        return series
    # A number that a newer board sends and we have no word for stays a number.
    words = series.map(lambda number: legend.get(number, str(number)), na_action="ignore")
    return words.astype("category")
