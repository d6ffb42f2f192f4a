"""Run logs to ROS 2 bags: a folder with an MCAP file of standard messages, a topic a channel.

The displacement is a `JointState` with the tendon force as its effort, each temperature a
`Temperature`, the force a `WrenchStamped` along x, what the log calls events are `Log`. All other
channels are numbers (`Float64`, `Int64`), whose time is that of the record. Lengths are in metres,
as ROS has them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smad.errors import RunLogError
from smad.extras import part
from smad.runlog.folders import whole_folder
from smad.runlog.reader import Run, recorded, row_near
from smad.runlog.schema import CHANNELS, Event

SUFFIX = ".rosbag2"
METADATA = "metadata.yaml"
EVENTS = "/smad/events"
JOINT_TOPIC = "/smad/joint_states"
JOINT = "tendon"
_VERSION = 8
"""Of the bag's format: the older one of the two that rosbags writes."""
_LEVELS = {"fault": 40, "warning": 30}
_INFO = 20
_NEVER = ("t_s", "host_time_s")
Times = NDArray[np.int64]


@dataclass(frozen=True)
class _Topic:
    """One topic: its message type, its rows with their times, and what makes a row's message."""

    name: str
    kind: str
    rows: NDArray[np.intp]
    stamps: Times | list[int]
    message: Callable[[int, int], Any]


def export_bag(run: Run, target: Path, *, overwrite: bool = False) -> Path:
    """Write `run` as the folder `target`; returns it.

    Raises RunLogError for a run without rows, a target that is there (with `overwrite`: that is no
    bag), or a disk that refuses; MissingPartError without rosbags.
    """
    if not len(run):
        raise RunLogError(f"{run.path} holds no rows", action="there is nothing to export")
    with whole_folder(target, METADATA, "bag", overwrite=overwrite) as folder:
        _write(run, folder)
    return target


def times_ns(run: Run) -> Times:
    """Time of each sample in Unix nanoseconds, shape (n,), never going back.

    Board time from where the computer's clock stood at the first sample; after a restart of the
    board, from where it stood then. Without that clock, from 0.
    """
    t_s = np.asarray(run.columns["t_s"], dtype=np.float64)
    host_s = np.asarray(run.columns["host_time_s"], dtype=np.float64)
    begins = np.r_[0, np.flatnonzero(np.diff(t_s) < 0) + 1]
    out = np.empty(len(t_s), dtype=np.int64)
    end = 0
    for start, stop in zip(begins, np.r_[begins[1:], len(t_s)], strict=True):
        from_s = host_s[start] if np.isfinite(host_s[start]) else 0.0
        if not start and not np.isfinite(host_s[0]):
            from_s = run.header.started_unix_s
        base = max(round(from_s * 1e9), end)
        out[start:stop] = base + np.rint((t_s[start:stop] - t_s[start]) * 1e9).astype(np.int64)
        end = int(out[stop - 1])
    return out


def _write(run: Run, folder: Path) -> None:
    rosbag2, typesys = part("rosbags.rosbag2"), part("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    stamps = times_ns(run)
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(folder, version=_VERSION, storage_plugin=plugin) as bag:
        for topic in (*_topics(run, store.types, stamps), *_events(run, store.types, stamps)):
            connection = bag.add_connection(topic.name, topic.kind, typestore=store)
            for row in topic.rows:
                when = int(topic.stamps[row])
                message = topic.message(int(row), when)
                bag.write(connection, when, store.serialize_cdr(message, topic.kind))


def _topics(run: Run, types: Any, stamps: Times) -> Iterator[_Topic]:
    columns = {name: c for name, c in run.columns.items() if recorded(c).any()}
    if "displacement_mm" in columns:
        yield _joint(columns, types, stamps)
    for name in (n for n in columns if n not in _NEVER and n != "displacement_mm"):
        yield _of_channel(name, columns[name], types, stamps)


def _of_channel(name: str, column: Any, types: Any, stamps: Times) -> _Topic:
    def numbers(row: int, when: int) -> Any:
        return types[kind](data=column[row].item())

    def temperature(row: int, when: int) -> Any:
        # A variance of 0 stands for "unknown" in ROS.
        return types[kind](_header(types, when), column[row].item(), 0.0)

    def wrench(row: int, when: int) -> Any:
        vector, none = types["geometry_msgs/msg/Vector3"], (0.0, 0.0, 0.0)
        force = types["geometry_msgs/msg/Wrench"](vector(column[row].item(), 0, 0), vector(*none))
        return types[kind](_header(types, when), force)

    if CHANNELS[name].unit == "degC":
        kind, message = "sensor_msgs/msg/Temperature", temperature
    elif name == "force_N":
        kind, message = "geometry_msgs/msg/WrenchStamped", wrench
    else:
        kind = f"std_msgs/msg/{'Float64' if CHANNELS[name].kind == 'float' else 'Int64'}"
        message = numbers
    return _Topic(f"/smad/{name}", kind, np.flatnonzero(recorded(column)), stamps, message)


def _joint(columns: Any, types: Any, stamps: Times) -> _Topic:
    kind = "sensor_msgs/msg/JointState"
    at_mm, force = columns["displacement_mm"], columns.get("force_N")

    def joint(row: int, when: int) -> Any:
        measured = force is not None and np.isfinite(force[row])
        effort = np.array([force[row]] if measured else [])
        at_m = np.array([at_mm[row] * 1e-3])
        return types[kind](_header(types, when), [JOINT], at_m, np.array([]), effort)

    return _Topic(JOINT_TOPIC, kind, np.flatnonzero(recorded(at_mm)), stamps, joint)


def _events(run: Run, types: Any, stamps: Times) -> Iterator[_Topic]:
    if not run.events:
        return
    kind = "rcl_interfaces/msg/Log"
    whens = [_when(event, run, stamps) for event in run.events]

    def log(row: int, when: int) -> Any:
        event = run.events[row]
        level = _LEVELS.get(event.kind, _INFO)
        return types[kind](_stamp(types, when), level, f"smad.{event.kind}", event.text, "", "", 0)

    yield _Topic(EVENTS, kind, np.arange(len(run.events)), whens, log)


def _when(event: Event, run: Run, stamps: Times) -> int:
    """By the board's clock where the event has it, by the computer's otherwise."""
    if event.t_s is not None:
        nearest = row_near(run, event, event.t_s)
        after_ns = round(float(event.t_s - run.columns["t_s"][nearest]) * 1e9)
        return max(int(stamps[nearest]) + after_ns, 0)
    host_s = event.host_time_s
    return int(stamps[0]) if host_s is None else max(round(host_s * 1e9), 0)


def _header(types: Any, when_ns: int) -> Any:
    return types["std_msgs/msg/Header"](_stamp(types, when_ns), "bench")


def _stamp(types: Any, when_ns: int) -> Any:
    return types["builtin_interfaces/msg/Time"](when_ns // 10**9, when_ns % 10**9)
