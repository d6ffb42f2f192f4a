"""A run log as the page looks back over it, also while it is written: extremes of stretches.

A follower knows where in the file each chunk stands and when it was recorded, so a short span is
read from its own chunks alone. Of long spans half-seconds are kept, each read once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from struct import Struct as Layout
from typing import NamedTuple

import msgspec
import numpy as np
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from smad.arrays import Array
from smad.runlog import schema
from smad.runlog.cycles import Cycles
from smad.runlog.mcap_file import CHANNEL_IDS
from smad.runlog.paths import part_path
from smad.runlog.reader import columns_of, recorded
from smad.runlog.scan import RECORD_HEAD, DamagedError, Message, chunk_data, records_in
from smad.style.decimation import in_order, stride
from smad.style.strips import MOTION, PLACES
from smad.view.replies import Mark, Read
from smad.view.tier import GAP_S, MOST_BUCKETS, MOST_MOMENTS, Curve, Frame, Moments

KEPT_S = 0.5
"""Length of the stretches that are kept of a log: 54 MB a day."""
ROWS_AT_ONCE = 20_000
MOST_MARKS = 500
MARKED = frozenset({"note", "fault", "warning"})
_TIMES = Layout("<QQ")
_CHANNEL = Layout("<HHI")
_EVENT = CHANNEL_IDS[schema.Event]
_row = msgspec.json.Decoder(schema.Row).decode
_event = msgspec.json.Decoder(schema.Event).decode
_NS = 1e-9


class Envelopes(NamedTuple):
    """n stretches of all channels: `t` (n,), the others (n, channels)."""

    t: Array
    low: Array
    high: Array
    first: Array
    last: Array

    def part(self, begin: int, end: int) -> Envelopes:
        """Return stretches `begin` to `end`."""
        return Envelopes(*(column[begin:end] for column in self))

    def folded(self, width_s: float) -> Envelopes:
        """Return them put together into stretches of a width."""
        if not self.t.size:
            return self
        starts = np.flatnonzero(np.diff(np.floor(self.t / width_s), prepend=np.nan) != 0)
        ends = np.append(starts[1:], self.t.size) - 1
        return Envelopes(
            self.t[starts],
            np.fmin.reduceat(self.low, starts),
            np.fmax.reduceat(self.high, starts),
            self.first[starts],
            self.last[ends],
        )


def joined(parts: Sequence[Envelopes]) -> Envelopes:
    """Return stretches one after the other."""
    return Envelopes(*map(np.concatenate, zip(*parts, strict=True)))


def of_rows(t: Array, y: Array) -> Envelopes:
    """Return each row as a stretch of its own; `t` (n,), `y` (n, channels), NaN: not measured."""
    return Envelopes(t, y, y, y, y)


class Follower:
    """One axis in one file of a run log, which may still grow."""

    def __init__(self, path: Path, axis: str) -> None:
        self._path = path
        self._topic = schema.row_topic(axis).encode()
        self._rows_id = 0
        self._position = len(MCAP0_MAGIC)
        self._places: list[tuple[int, int]] = []
        self._begin_s: list[float] = []
        self._end_s: list[float] = []
        self._folded: list[Envelopes] = []
        self._kept_chunks = 0
        self._seen: set[int] = set()
        self.marks: list[Mark] = []

    @property
    def first_s(self) -> float:
        """When the first chunk begins; infinite while there is none."""
        return self._begin_s[0] if self._begin_s else np.inf

    @property
    def last_s(self) -> float:
        """When the last chunk ends."""
        return self._end_s[-1] if self._end_s else -np.inf

    def refresh(self) -> None:
        """Find the chunks that were written since. Raises OSError."""
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            while self._position + RECORD_HEAD.size <= size:
                file.seek(self._position)
                opcode, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
                end = self._position + RECORD_HEAD.size + length
                if opcode == 0 or end > size or opcode == Opcode.DATA_END:
                    break
                if opcode == Opcode.CHANNEL:
                    number, _, size_B = _CHANNEL.unpack(file.read(_CHANNEL.size))
                    if file.read(size_B) == self._topic:
                        self._rows_id = number
                if opcode == Opcode.CHUNK:
                    begin_ns, end_ns = _TIMES.unpack(file.read(_TIMES.size))
                    self._places.append((self._position + RECORD_HEAD.size, length))
                    self._begin_s.append(begin_ns * _NS)
                    self._end_s.append(end_ns * _NS)
                self._position = end

    def between(self, from_s: float, to_s: float) -> Envelopes:
        """Return rows between two times, or half-seconds where that suffices. Raises OSError."""
        if to_s - from_s > KEPT_S * MOST_BUCKETS:
            self._keep()
            envelopes = joined(self._folded) if self._folded else of_rows(np.empty(0), _no_rows())
        else:
            # Chunks are in the order of their times, but for what a step of a clock does.
            begin = int(np.searchsorted(self._end_s, from_s, "left"))
            end = int(np.searchsorted(self._begin_s, to_s, "right"))
            envelopes = of_rows(*self._rows(max(0, begin - 1), min(len(self._places), end + 1)))
        inside = np.flatnonzero((envelopes.t >= from_s) & (envelopes.t <= to_s))
        if not inside.size:
            return envelopes.part(0, 0)
        return envelopes.part(max(0, int(inside[0]) - 1), int(inside[-1]) + 2)

    def _keep(self) -> None:
        while self._kept_chunks < len(self._places):
            t, y = self._rows(self._kept_chunks, len(self._places), ROWS_AT_ONCE)
            if t.size:
                self._folded.append(of_rows(t, y).folded(KEPT_S))
            self._kept_chunks = self._read_to
        if len(self._folded) > 1:
            self._folded = [joined(self._folded)]

    def _rows(self, begin: int, end: int, most: float = np.inf) -> tuple[Array, Array]:
        """Times and values of the rows of some chunks; stops after the one that makes it `most`."""
        times: list[float] = []
        rows: list[schema.Row] = []
        self._read_to = begin
        with self._path.open("rb") as file:
            for chunk in range(begin, end):
                place, length = self._places[chunk]
                file.seek(place)
                for message in _messages(file.read(length)):
                    if message.channel_id == self._rows_id:
                        times.append(message.time_ns * _NS)
                        rows.append(_row(message.body))
                    elif message.channel_id == _EVENT and chunk not in self._seen:
                        self._mark(message)
                self._seen.add(chunk)
                self._read_to = chunk + 1
                if len(rows) >= most:
                    break
        columns = columns_of(rows)
        y = (
            np.stack(
                [np.where(recorded(columns[name]), columns[name], np.nan) for name in PLACES],
                axis=1,
            )
            if rows
            else _no_rows()
        )
        return np.array(times), y.astype(np.float64)

    def _mark(self, message: Message) -> None:
        event = _event(message.body)
        if event.kind in MARKED and len(self.marks) < MOST_MARKS:
            self.marks.append(Mark(round(message.time_ns * _NS, 3), event.text))


class Log:
    """One axis of a run log with all its parts."""

    def __init__(self, path: Path, axis: str) -> None:
        self._path = path
        self._axis = axis
        self._parts: list[Follower] = []

    def read(self, from_s: float, to_s: float, channels: Sequence[str], xy: Sequence[str]) -> Read:
        """Return what it holds between two times. Raises OSError."""
        self._find_parts()
        for part in self._parts:
            part.refresh()
        inside = [p for p in self._parts if p.first_s <= to_s and p.last_s >= from_s]
        parts = [part.between(from_s, to_s) for part in inside]
        envelopes = joined(parts) if parts else of_rows(np.empty(0), _no_rows())
        marks = [m for p in self._parts for m in p.marks if from_s <= m.x <= to_s]
        last_s = float(max((p.last_s for p in self._parts), default=-np.inf))
        return Read(
            frame=frame_of(envelopes, (to_s - from_s) / MOST_BUCKETS, channels, last_s),
            moments=moments_of(envelopes, xy) if xy else None,
            marks=tuple(marks[-MOST_MARKS:]),
            first_s=float(min((p.first_s for p in self._parts), default=np.inf)),
            last_s=last_s,
        )

    def _find_parts(self) -> None:
        while True:
            count = len(self._parts) + 1
            path = self._path if count == 1 else part_path(self._path, count)
            if count > 1 and not path.exists():
                return
            self._parts.append(Follower(path, self._axis))


def frame_of(envelopes: Envelopes, width_s: float, channels: Sequence[str], last_s: float) -> Frame:
    """Return the curves of some channels: every row, or the extremes of stretches of a width.

    `last_s` is when the log ends.
    """
    if envelopes.t.size > 2 * MOST_BUCKETS:
        envelopes = envelopes.folded(width_s)
    single = np.array_equal(envelopes.low, envelopes.high, equal_nan=True)
    t = envelopes.t if single else np.repeat(envelopes.t, 2)
    if not single:
        # Of a log that has but a part of the span, stretches are shorter than their width there.
        t[1::2] += np.fmin(np.diff(envelopes.t, append=np.inf), width_s) / 2
        t = np.fmin(t, last_s)
    breaks = np.flatnonzero(np.diff(t) > max(GAP_S, 3 * width_s)) + 1
    times = np.insert(t, breaks, t[breaks] - 1e-3)
    y: list[Curve] = []
    for name in channels:
        k = PLACES[name]
        curve = envelopes.low[:, k]
        if not single:
            extremes = (envelopes.low, envelopes.high, envelopes.first, envelopes.last)
            curve = in_order(*(values[:, k] for values in extremes))
        y.append(_listed(np.insert(curve, breaks, np.nan)))
    return Frame(float(times[0]) if times.size else 0.0, np.round(times, 5).tolist(), y)


def moments_of(envelopes: Envelopes, xy: Sequence[str]) -> Moments:
    """Return at most 3000 moments; cycles count from the first of them."""
    step = stride(envelopes.t.size, MOST_MOMENTS)
    t, last = envelopes.t[::step], envelopes.last[::step]
    cycles = Cycles()
    numbers = [cycles.add(value) for value in last[:, MOTION].tolist()]
    y = [_listed(last[:, PLACES[name]]) for name in xy]
    return Moments(float(t[0]) if t.size else 0.0, np.round(t, 5).tolist(), numbers, y)


def _listed(values: Array) -> Curve:
    return [None if math.isnan(v) else v for v in np.round(values, 4).tolist()]


def _no_rows() -> Array:
    return np.empty((0, len(PLACES)))


def _messages(chunk: bytes) -> list[Message]:
    """The messages of a chunk; none of one that is damaged."""
    try:
        return [record for record in records_in(chunk_data(chunk)) if isinstance(record, Message)]
    except DamagedError:
        return []
