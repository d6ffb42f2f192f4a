"""A rosbag2 (or ROS 1 bag) as a table: its numbers as columns, a row for each message of one topic.

A column is `TOPIC.FIELD`, an element of an array `TOPIC.FIELD[0]`, a joint's
`/joint_states.position[elbow]`. What `export_bag` wrote has the names of its channels. Rows are the
messages of the topic with most of them; beside each stands the last value that every other column
had by then, unless it is too old (`_longest_ns`). Times are those at which the bag recorded.
"""

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smad.arrays import Array
from smad.errors import LogImportError, first_line
from smad.extras import part
from smad.runlog.bounds import require_bounded
from smad.runlog.rosbag import JOINT, JOINT_TOPIC, METADATA
from smad.runlog.schema import CHANNELS

TIME = "t_s"
_MOST_ELEMENTS = 64
"""Of an array in a message; a longer one is an image or a cloud."""
_LEFT_OUT = ("header", "name", "__msgtype__")
_NUMBER_BYTES = 8


def is_bag(path: Path) -> bool:
    """Whether the path is a bag: a folder with metadata, or a ROS 1 file."""
    return (path / METADATA).is_file() or path.suffix == ".bag"


@dataclass(frozen=True)
class BagTable:
    """A bag of which the names of the columns are known; `places` says which topic each is of."""

    path: Path
    places: Mapping[str, tuple[str, str]]
    counts: Mapping[str, int]
    stamps: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """Every column."""
        return [TIME, *self.places]

    @property
    def most_rows(self) -> int:
        """Messages of the topic that has most."""
        return max(self.counts.values(), default=0)

    def columns(self, wanted: Iterable[str]) -> Iterator[tuple[str, Array]]:
        """The columns named. Raises LogImportError for a bag that cannot be read to its end."""
        wanted = list(wanted)
        topics = {self.places[name][0] for name in wanted if name != TIME}
        if not topics:
            raise LogImportError(
                f"{self.path}: no column of it is a channel",
                value=", ".join(self.places),
                action="assign its columns in a mapping file",
            )
        series = self._series([name for name in wanted if name != TIME], topics)
        # Of equal ones the first by name: a set has another order in each process.
        base = max(sorted(topics), key=lambda topic: self.counts[topic])
        stamps = next(s for name, (s, _) in series.items() if self.places[name][0] == base)
        # Two messages at one time are one sample, the later one.
        stamps = np.unique(stamps)
        for name in wanted:
            if name == TIME:
                yield name, (stamps - stamps[0]) * 1e-9
                continue
            column_stamps, values = series[name]
            last = np.searchsorted(column_stamps, stamps, side="right") - 1
            old = (last < 0) | (stamps - column_stamps[last] > _longest_ns(column_stamps, stamps))
            yield name, np.where(old, np.nan, values[last])

    def place_of(self, row: int) -> str:
        """Where that row is to be found."""
        return f"message {row + 1}"

    def _series(
        self, wanted: list[str], topics: set[str]
    ) -> dict[str, tuple[NDArray[np.int64], Array]]:
        fields: dict[str, list[tuple[str, str]]] = {topic: [] for topic in topics}
        for name in wanted:
            topic, field = self.places[name]
            fields[topic].append((name, field))
        stamps: dict[str, list[int]] = {topic: [] for topic in topics}
        values: dict[str, list[float]] = {name: [] for name in wanted}
        with _reader(self.path) as reader:
            connections = [c for c in reader.connections if c.topic in topics]
            for connection, when, raw in reader.messages(connections):
                message_fields = _flat(reader.deserialize(raw, connection.msgtype))
                stamps[connection.topic].append(when)
                for name, field in fields[connection.topic]:
                    values[name].append(message_fields.get(field, np.nan))
        return {
            name: (np.array(stamps[self.places[name][0]]), np.array(values[name]))
            for name in wanted
        }


def _longest_ns(column_stamps: NDArray[np.int64], stamps: NDArray[np.int64]) -> float:
    """How old a value may be to stand for a row, ns.

    A column as fast as the rows has a value of its own for each, and one that is missing stays so.
    A slower one stands until its next message is half a period late.
    """
    if len(column_stamps) < 2 or len(stamps) < 2:
        return np.inf
    row_ns, column_ns = (
        float(np.quantile(np.diff(times), 0.1)) for times in (stamps, column_stamps)
    )
    if column_ns <= 1.5 * row_ns:
        return 0.5 * row_ns
    return 1.5 * float(np.median(np.diff(column_stamps)))


def open_bag(path: Path) -> BagTable:
    """Look at a bag: its topics, and the numbers in the first message of each.

    Raises LogImportError for what is no bag, or more than a run can hold; MissingPartError without
    rosbags.
    """
    places: dict[str, tuple[str, str]] = {}
    counts: dict[str, int] = {}
    with _reader(path) as reader:
        for connection in reader.connections:
            first = next(iter(reader.messages([connection])), None)
            if first is None:
                continue
            fields = _flat(reader.deserialize(first[2], connection.msgtype))
            if not fields:
                continue
            topic = connection.topic
            counts[topic] = counts.get(topic, 0) + connection.msgcount
            for field in fields:
                places.setdefault(_named(topic, field), (topic, field))
    rows = max(counts.values(), default=0)
    if not rows:
        raise LogImportError(f"{path} holds no numbers", action="there is nothing to import")
    require_bounded(path, columns=len(places), rows=rows, size=_NUMBER_BYTES * rows * len(places))
    return BagTable(path, places, counts)


def _named(topic: str, field: str) -> str:
    """A column's name: the channel's of what we exported, else topic and field."""
    if topic == JOINT_TOPIC:
        # The effort is the tension again, which has a topic.
        return "displacement_m" if field == f"position[{JOINT}]" else f"{topic}.{field}"
    channel = topic.removeprefix("/smad/")
    whole = {"data", "temperature", "wrench.force.x"}
    return channel if channel in CHANNELS and field in whole else f"{topic}.{field}"


def _flat(message: Any, before: str = "") -> dict[str, float]:
    """Every number of a message by its field, nested ones with dots."""
    joints = list(getattr(message, "name", None) or ()) if not before else []
    fields: dict[str, float] = {}
    for name in getattr(message, "__dataclass_fields__", ()):
        if name in _LEFT_OUT:
            continue
        value, label = getattr(message, name), f"{before}{name}"
        if isinstance(value, bool | int | float | np.number):
            fields[label] = float(value)
        elif hasattr(value, "__dataclass_fields__"):
            fields |= _flat(value, f"{label}.")
        elif isinstance(value, np.ndarray | list) and len(value) <= _MOST_ELEMENTS:
            labels = joints if len(joints) == len(value) else [str(n) for n in range(len(value))]
            for element_label, element in zip(labels, value, strict=True):
                if isinstance(element, bool | int | float | np.number):
                    fields[f"{label}[{element_label}]"] = float(element)
    return fields


@contextlib.contextmanager
def _reader(path: Path) -> Iterator[Any]:
    """A reader of rosbags over one bag, whose errors name the bag."""
    highlevel, typesys = part("rosbags.highlevel"), part("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    try:
        with highlevel.AnyReader([path], default_typestore=store) as reader:
            yield reader
    except LogImportError:
        raise
    except Exception as error:  # of rosbags, yaml, sqlite and zstandard alike
        reason = f"cannot read {path}: {first_line(error)}"
        raise LogImportError(reason, action="restore the bag") from error
