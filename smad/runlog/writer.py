"""Recording a run. `RunWriter` writes from a thread and never holds up its caller.

The caller pays for encoding one record (a few microseconds); the thread compresses and writes,
which the interpreter does without its lock. So the thread holds the lock for tens of microseconds
at a time, which is what a control loop in the same process can bear.

`write_run` writes a finished run in one go, for imports, recovery and simulated runs.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
import time
from collections import deque
from collections.abc import Iterable
from io import FileIO
from pathlib import Path

import msgspec

from smad.counted import counted
from smad.errors import RunLogError, refused_by_system
from smad.runlog import open_logs
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.mcap_file import MESSAGES_A_CHUNK, McapFile, Packed
from smad.runlog.pack import RecordPacker
from smad.runlog.paths import make_folder, part_path
from smad.runlog.schema import Event, Record, Row

END_METADATA_NAME = "smad.end"
_PAUSE_BETWEEN_CHUNKS_S = 0.001
_LOOK_S = 1.0
_NS = 1_000_000_000


class RunWriter:
    """Writes a run to `path` from a thread of its own, and to further parts when it grows long.

    `append` and `close` belong to one thread. Nothing that happens to the disk raises there: it is
    found in `error`, and the rows that did not reach the file are counted in `dropped`. A record
    that cannot be encoded is left out, and an event in the log says why.

    The thread runs at the priority of whoever creates the writer, less one: create it after the
    real-time measures are taken, or a busy machine can suspend it while it holds the interpreter.

    Raises RunLogError when the file cannot be created, or is there already.
    """

    def __init__(
        self,
        path: str | Path,
        header: RunHeader,
        *,
        flush_interval_s: float = 0.25,
        queue_rows: int = 20_000,
        max_file_bytes: float = float("inf"),
        max_file_s: float = float("inf"),
    ) -> None:
        self.paths = [Path(path)]
        self.error: str | None = None
        self.written = 0
        # Counters of one thread each: += is not atomic. Queue full, unfit: the caller's.
        self._refused = 0
        self._unfit = 0
        self._lost = 0
        self._header = header
        self._flush_interval_s = flush_interval_s
        self._queue_rows = queue_rows
        self._max_file_bytes = max_file_bytes
        self._max_file_ns = max_file_s * _NS
        self._queue: deque[Packed] = deque()
        self._packer = RecordPacker(header.started_unix_s, header.axes)
        self._refused_told = self._unfit_told = 0
        self._unfit_why = ""
        self._mcap, self._file = create_log(self.paths[0], header)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="run log", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Records that did not reach the file."""
        return self._refused + self._unfit + self._lost

    def append(self, record: Record, axis: str = "", time_s: float | None = None) -> bool:
        """Hand over a record; False when it was dropped (counted in `dropped`). Never blocks.

        `axis` and `time_s` as for `RecordPacker.pack`.
        """
        if self.error is not None or len(self._queue) >= self._queue_rows:
            self._refused += 1
            return False
        try:
            self._queue.append(self._packer.pack(record, axis, time_s))
        except (TypeError, ValueError, OverflowError, KeyError) as error:
            self._unfit_why = str(error)
            self._unfit += 1
            return False
        return True

    def close(self, timeout_s: float = 10.0) -> None:
        """Write what is queued, the summary, and close. Returns at the latest after `timeout_s`.

        A disk that hangs beyond that is reported in `error`; the file then has no summary, and
        reads as a log that was cut.
        """
        self._stop.set()
        self._thread.join(timeout_s)
        if self._thread.is_alive() and self.error is None:
            self.error = f"the disk did not answer within {timeout_s:g} s of closing"

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            _step_below_creator()
            next_look_s = time.monotonic() + _LOOK_S
            while not self._stop.wait(self._flush_interval_s):
                self._drain()
                if time.monotonic() >= next_look_s:
                    next_look_s = time.monotonic() + _LOOK_S
                    self._look()
            self._drain()
            self._look()
            if not self._file.closed:
                self._end_file()
        except Exception as error:
            # A recorder that ends without a word is worse than any error.
            self._give_up(error)

    def _drain(self) -> None:
        # Only what is there now: a fast caller must not keep this loop from ending.
        waiting = len(self._queue)
        while waiting > 0:
            batch = [self._queue.popleft() for _ in range(min(waiting, MESSAGES_A_CHUNK))]
            waiting -= len(batch)
            self._write(batch)
            if waiting:
                time.sleep(_PAUSE_BETWEEN_CHUNKS_S)

    def _write(self, batch: list[Packed]) -> None:
        if self._file.closed:
            self._lost += len(batch)
            return
        try:
            self._mcap.write_chunk([*batch, *self._drop_notices(batch[-1].time_ns)])
        except OSError as error:
            self._lost += len(batch)
            self._give_up(error)
            return
        self.written += len(batch)
        try:
            self._start_next_part_if_due()
        except RunLogError as error:
            self._give_up(error)

    def _look(self) -> None:
        """Give up if the file is no longer where it was: what is written then is lost."""
        if self._file.closed:
            return
        try:
            in_place = os.path.samestat(os.stat(self.paths[-1]), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            in_place = False
        except OSError:
            # What is said of the folder is not said of the file: writing will tell.
            return
        if not in_place:
            self._give_up(RunLogError("it was deleted, moved or replaced"))

    def _drop_notices(self, time_ns: int) -> list[Packed]:
        """What was dropped since the last notice, as events."""
        refused, unfit = self._refused - self._refused_told, self._unfit - self._unfit_told
        self._refused_told += refused
        self._unfit_told += unfit
        losses = (
            (refused, f"{counted(refused, 'row')} dropped: the disk was too slow for the queue"),
            (unfit, f"{counted(unfit, 'record')} dropped, not writable: {self._unfit_why}"),
        )
        at_s, packer = time_ns / _NS, RecordPacker(0.0)
        return [
            packer.pack(Event(host_time_s=at_s, kind="record", text=text, data={"dropped": count}))
            for count, text in losses
            if count
        ]

    def _start_next_part_if_due(self) -> None:
        # By the rows: an event may carry the host's clock, which somebody may set.
        if self._mcap.size_bytes < self._max_file_bytes and self._mcap.rows_ns < self._max_file_ns:
            return
        self._end_file()
        part = len(self.paths) + 1
        path = part_path(self.paths[0], part)
        self._mcap, self._file = create_log(path, msgspec.structs.replace(self._header, part=part))
        self.paths.append(path)

    def _end_file(self) -> None:
        try:
            self._mcap.write_metadata(END_METADATA_NAME, {"dropped": str(self.dropped)})
            self._mcap.finish()
            os.fsync(self._file.fileno())
        except OSError as error:
            self._latch(error)
        finally:
            self._file.close()

    def _give_up(self, error: Exception) -> None:
        self._latch(error)
        if not self._file.closed:
            self._end_file()

    def _latch(self, error: Exception) -> None:
        if self.error is None:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            self.error = f"cannot write {self.paths[-1]}: {reason}; rows are no longer recorded"


def write_run(
    path: str | Path, header: RunHeader, records: Iterable[Record | tuple[Row, str, float]]
) -> int:
    """Write a whole run to a new file; returns how many records it holds.

    A sample of one of several axes (`header.axes`) comes with the axis and its Unix time.

    Raises RunLogError when the file is there already or cannot be written; nothing is left behind
    then, nor when `records` raises.
    """
    path = Path(path)
    mcap, file = create_log(path, header)
    packer = RecordPacker(header.started_unix_s, header.axes)
    cause, action = f"cannot write {path}", "free some space or choose a folder"
    try:
        with refused_by_system(RunLogError, cause, action=action), file:
            for record in records:
                mcap.add(packer.pack(*(record if isinstance(record, tuple) else (record,))))
            mcap.write_metadata(END_METADATA_NAME, {"dropped": "0"})
            mcap.finish()
    except BaseException:
        # A disk that refused what was written may refuse this, too.
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        raise
    return packer.packed


def require_new(path: Path) -> None:
    """Raises RunLogError for a log that is there already."""
    if path.exists():
        raise _taken(path)


def _taken(path: Path) -> RunLogError:
    return RunLogError(
        f"{path} is there already", action="choose another name; logs are never overwritten"
    )


def create_log(path: Path, header: RunHeader) -> tuple[McapFile, FileIO]:
    """Create a log with its header. Raises RunLogError when it is there already or cannot be."""
    make_folder(path.parent)
    try:
        file = FileIO(path, "xb")
    except FileExistsError:
        raise _taken(path) from None
    except OSError as error:
        raise RunLogError(
            f"cannot create {path}: {error.strerror}",
            action="name another file, or another folder ([recorder] folder in the configuration)",
        ) from error
    cause, action = f"cannot write {path}", "free some space or choose a folder"
    with refused_by_system(RunLogError, cause, action=action):
        try:
            open_logs.mark(file)
            mcap = McapFile(file)
            for axis in header.axes:
                mcap.add_axis(axis)
            mcap.write_metadata(METADATA_NAME, header.to_metadata())
        except OSError:
            file.close()
            path.unlink(missing_ok=True)
            raise
    return mcap, file


def obstacle_to_log(folder: Path) -> str:
    """Return why no log can be created in a folder, as far as that is seen; empty: nothing is."""
    try:
        existing = next(place for place in (folder, *folder.parents) if place.exists())
        disk = os.statvfs(existing)
    except OSError as error:
        why = error.strerror or str(error)
    else:
        # What is kept for root is room for a daemon of root's.
        free = disk.f_bavail if os.geteuid() else disk.f_bfree
        if not existing.is_dir():
            why = os.strerror(errno.ENOTDIR)
        elif not os.access(existing, os.W_OK | os.X_OK):
            why = os.strerror(errno.EACCES)
        elif disk.f_blocks and not free:
            why = os.strerror(errno.ENOSPC)
        else:
            return ""
    action = "free some space or choose another ([recorder] folder in the configuration)"
    return f"no run log can be created in {folder}: {why}; {action}"


def _step_below_creator() -> None:
    if not hasattr(os, "sched_getscheduler"):
        return
    policy = os.sched_getscheduler(0)
    priority = os.sched_getparam(0).sched_priority
    if policy in (os.SCHED_FIFO, os.SCHED_RR) and priority > 1:
        os.sched_setscheduler(0, policy, os.sched_param(priority - 1))
