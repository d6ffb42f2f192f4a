"""The last minute of every channel and event, in memory, armed or not; written when asked for.

What is kept is bounded in time and in bytes. It is written by a thread, a few rows at a time, so
that the control loop waits for neither the disk nor the interpreter.
"""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import msgspec

from smad.daemon.realtime import step_below_loop
from smad.errors import RunLogError
from smad.runlog.header import RunHeader
from smad.runlog.paths import make_folder, new_run_path
from smad.runlog.schema import Event, LinkSample, Record, Row
from smad.runlog.writer import RunWriter

FOLDER = "black-box"
"""Of the folder of run logs: the newest run there stays the newest run."""
MOST_BYTES = 96_000_000
AFTERMATH_S = 2.0
"""What follows a fault is written, too."""
_ROWS_AT_ONCE = 50
_PAUSE_S = 0.002

_encode = msgspec.msgpack.Encoder().encode
_DECODERS: dict[type[Record], Callable[[bytes], Record]] = {
    Row: msgspec.msgpack.Decoder(Row).decode,
    Event: msgspec.msgpack.Decoder(Event).decode,
    LinkSample: msgspec.msgpack.Decoder(LinkSample).decode,
}


class _Kept(NamedTuple):
    wall_s: float
    kind: type[Row] | type[Event] | type[LinkSample]
    data: bytes
    axis: str
    stamp_s: float | None


class BlackBox:
    """Keeps what passed in the last `keep_s` seconds (0: nothing), and writes it.

    `header` builds the header of a log from its name; `say` tells the journal what was written.
    """

    def __init__(
        self,
        keep_s: float,
        folder: Path,
        header: Callable[[str], RunHeader],
        wall_clock: Callable[[], float],
        say: Callable[[str], None],
    ) -> None:
        self.keep_s = keep_s
        self.path = ""
        """What was written last."""
        self._folder = folder / FOLDER
        self._header = header
        self._wall_clock = wall_clock
        self._say = say
        self._kept: deque[_Kept] = deque()
        self._bytes = 0
        self._why = ""
        self._due_s = 0.0
        self._written_s = float("-inf")
        self._let_others_run = threading.Event()
        self._worker = ThreadPoolExecutor(
            1, thread_name_prefix="black box", initializer=step_below_loop
        )

    def row(self, row: Row, axis: str = "", stamp_s: float | None = None) -> None:
        """Keep a sample, of a named axis under its Unix time."""
        self._keep(Row, row, axis, stamp_s)

    def note(self, record: Event | LinkSample) -> None:
        """Keep something beside the samples."""
        self._keep(type(record), record)

    def want(self, why: str) -> None:
        """Have it written soon, for this reason; what is written already is not written again."""
        if self._why or not self._kept:
            return
        self._why = why
        self._due_s = max(self._wall_clock() + AFTERMATH_S, self._written_s + self.keep_s)

    @property
    def due(self) -> bool:
        """Whether what was wanted is to be written now."""
        return bool(self._why) and self._wall_clock() >= self._due_s

    async def write_wanted(self) -> None:
        """Write what was wanted; a disk that does not take it is told, and the daemon goes on."""
        self._why = ""
        try:
            await self.write(self.keep_s)
        except RunLogError as error:
            self._say(f"the last {self.keep_s:g} s could not be written: {error}")
        else:
            self._say(f"the last {self.keep_s:g} s are in {self.path}")

    async def write(self, seconds: float) -> int:
        """Write the last seconds into a log; return how many samples. Raises RunLogError."""
        from_s = self._wall_clock() - seconds
        self._written_s = self._wall_clock()
        kept = [entry for entry in self._kept if entry.wall_s >= from_s]
        loop = asyncio.get_running_loop()
        path = await loop.run_in_executor(self._worker, self._write, kept, self._wall_clock())
        self.path = str(path)
        return sum(entry.kind is Row for entry in kept)

    def close(self) -> None:
        """Finish what is being written."""
        self._worker.shutdown(wait=True)

    def _keep(
        self,
        kind: type[Row] | type[Event] | type[LinkSample],
        record: Record,
        axis: str = "",
        stamp_s: float | None = None,
    ) -> None:
        if self.keep_s <= 0:
            return
        now_s = self._wall_clock()
        try:
            data = _encode(record)
        except (TypeError, ValueError, OverflowError):
            # The details of an event that no file could hold either.
            return
        self._kept.append(_Kept(now_s, kind, data, axis, stamp_s))
        self._bytes += len(data)
        # A clock that was set back keeps more for a while; the bytes bound that.
        while self._kept[0].wall_s < now_s - self.keep_s or self._bytes > MOST_BYTES:
            self._bytes -= len(self._kept.popleft().data)

    def _write(self, kept: list[_Kept], now_s: float) -> Path:
        make_folder(self._folder)
        path = new_run_path(self._folder, "last", datetime.fromtimestamp(now_s))
        began_s = kept[0].stamp_s or kept[0].wall_s if kept else now_s
        header = msgspec.structs.replace(self._header("last"), started_unix_s=began_s)
        with RunWriter(path, header, queue_rows=max(1, len(kept))) as writer:
            for number, entry in enumerate(kept):
                writer.append(_DECODERS[entry.kind](entry.data), entry.axis, entry.stamp_s)
                if number % _ROWS_AT_ONCE == 0:
                    self._let_others_run.wait(_PAUSE_S)
        if writer.error is not None:
            raise RunLogError(writer.error, value=str(path), action="see the disk")
        return path
