"""The run log of the daemon: opened and closed away from the loop, fed from it without waiting."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime
from pathlib import Path

import msgspec

from smad.api import Reason, RecorderStatus
from smad.config import RecorderConfig
from smad.daemon.errors import Refusal
from smad.daemon.realtime import step_below_loop
from smad.errors import RunLogError
from smad.runlog.header import RunHeader
from smad.runlog.paths import UNNAMED, new_run_path
from smad.runlog.schema import Event, LinkSample, Row
from smad.runlog.writer import RunWriter, obstacle_to_log

_BYTES_PER_MB = 1e6
_S_PER_MIN = 60.0


class Recorder:
    """At most one run log at a time.

    `header` builds the header of a new log from its name. A log begun by arming ends by itself
    some time after the bench is at rest; one begun by a command ends by command.
    """

    def __init__(
        self,
        config: RecorderConfig,
        header: Callable[[str], RunHeader],
        wall_clock: Callable[[], float],
    ) -> None:
        self._config = config
        # A client may be in another folder than the daemon: its path is absolute.
        self._folder = Path(config.folder).absolute()
        self._header = header
        self._wall_clock = wall_clock
        self._writer: RunWriter | None = None
        self._by_command = False
        self._path = ""
        self._rows = 0
        self._dropped = 0
        self._error = ""
        # One worker, so that opening and closing stay in order and off the loop.
        self._worker = ThreadPoolExecutor(
            1, thread_name_prefix="run log", initializer=step_below_loop
        )
        self._lock = asyncio.Lock()
        self._looking: Future[None] | None = None
        self._obstacle = ""

    @property
    def recording(self) -> bool:
        """Whether a log is open and takes rows: one that failed takes no more."""
        return self._writer is not None and not self._writer.error

    @property
    def ends_by_itself(self) -> bool:
        """Whether the open log was begun by arming."""
        return self._writer is not None and not self._by_command

    def status(self) -> RecorderStatus:
        """Return the state of the run log, as a client gets it."""
        writer = self._writer
        if writer is not None:
            self._dropped = writer.dropped
            self._error = writer.error or ""
        return RecorderStatus(
            recording=self.recording,
            path=self._path,
            folder=str(self._folder),
            rows=self._rows,
            dropped=self._dropped,
            error=self._error,
        )

    def failure(self) -> str:
        """Return why the open log takes no more rows; empty while it does."""
        return "" if self._writer is None else self._writer.error or ""

    @property
    def obstacle(self) -> str:
        """Why arming could not begin a log, when it was last looked; empty: nothing known."""
        return "" if self.recording else self._obstacle

    def look(self) -> None:
        """Have it looked, away from the loop, what keeps arming from beginning a log."""
        idle = self._looking is None or self._looking.done()
        if self._config.automatic and idle and not self.recording:
            self._looking = self._worker.submit(self._look)

    def _look(self) -> None:
        self._obstacle = obstacle_to_log(self._folder)

    async def start(self, name: str, *, by_command: bool, repeats: str = "") -> None:
        """Begin a log. Raises Refusal when one is open, or none can be created.

        A log that arming began makes way for one that is asked for by name, without losing a
        sample between them; without a name it goes on as the one that was asked for. One that
        failed makes way for any other.
        """
        async with self._lock:
            before = self._writer
            if before is not None and not before.error:
                if by_command and not self._by_command and not name:
                    self._by_command = True
                    return
                if not by_command or self._by_command:
                    raise _is_open(self._path)
            loop = asyncio.get_running_loop()
            self._writer = await loop.run_in_executor(
                self._worker, self._create, name or UNNAMED, repeats
            )
            self._by_command = by_command
            self._path = str(self._writer.paths[0])
            self._rows = 0
            self._dropped = 0
            self._error = ""
            if before is not None:
                await loop.run_in_executor(self._worker, before.close)

    def end_by_itself(self) -> None:
        """Who began the open log has vanished: it ends as one that arming began does."""
        self._by_command = False

    async def stop(self) -> None:
        """Close the log, if one is open; what is queued is written first."""
        async with self._lock:
            writer = self._writer
            if writer is None:
                return
            self._writer = None
            await asyncio.get_running_loop().run_in_executor(self._worker, writer.close)
            self._dropped = writer.dropped
            self._error = writer.error or ""

    def row(self, row: Row, axis: str = "", stamp_s: float | None = None) -> None:
        """Record one sample, of a named axis under its Unix time; never waits."""
        if self._writer is not None and self._writer.append(row, axis, stamp_s):
            self._rows += 1

    def note(self, record: Event | LinkSample) -> None:
        """Record something beside the samples; never waits."""
        if self._writer is not None:
            self._writer.append(record)

    def close(self) -> None:
        """End the worker."""
        self._worker.shutdown(wait=False)

    def _create(self, name: str, repeats: str) -> RunWriter:
        config = self._config
        when = datetime.fromtimestamp(self._wall_clock())
        try:
            return RunWriter(
                new_run_path(self._folder, name, when),
                msgspec.structs.replace(self._header(name), repeats=repeats),
                flush_interval_s=config.flush_interval_s,
                queue_rows=config.queue_rows,
                max_file_bytes=config.max_file_MB * _BYTES_PER_MB,
                max_file_s=config.max_file_min * _S_PER_MIN,
            )
        except RunLogError as error:
            raise Refusal(Reason.RECORDER, error.cause, **error.parts) from error


def _is_open(path: str) -> Refusal:
    return Refusal(
        Reason.RECORDER,
        f"a run is being recorded already, to {path}",
        action="stop it first (smad record stop)",
    )
