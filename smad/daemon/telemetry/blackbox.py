"""The last minute of every channel and event, in memory, armed or not; written when asked for.

What is kept is bounded in time and in bytes, as blocks of half a second: a writing takes over the
list of blocks, which costs the loop nothing, however much is kept. It is written by a thread, a few
rows at a time, so that the control loop waits for neither the disk nor the interpreter. What is
kept and when it is written go by the daemon's clock: the wall clock may be set.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import astuple

from smad.daemon.realtime import step_below_loop
from smad.daemon.services import Clocks
from smad.errors import RunLogError
from smad.progress import Say
from smad.runlog.header import RunHeader
from smad.runlog.paths import make_folder, new_run_path
from smad.runlog.schema import Event, LinkSample, Record, Row
from smad.runlog.writer import write_run

FOLDER = "black-box"
"""Of the folder of run logs: the newest run there stays the newest run."""
MOST_BYTES = 96_000_000
"""Of memory. A minute of six axes at 500 Hz takes 54 MB."""
ENTRY_BYTES = 49
"""That an entry takes beside its data: the object, and its place in a list."""
AFTERMATH_S = 2.0
"""What follows a fault is written, too."""
_BLOCKS = 128
"""In which the time and the bytes that are kept are divided, at least."""
_ROWS_AT_ONCE = 50
_PAUSE_S = 0.002

_encode = msgspec.msgpack.Encoder().encode
_KINDS: tuple[type[Record], ...] = (Row, Event, LinkSample)


class _Entry(NamedTuple):
    """As it is encoded: without the names of its fields, which would be most of it."""

    kind: int
    kept_s: float
    axis: str
    stamp_s: float | None
    values: tuple[Any, ...]

    def record(self) -> Record:
        """Return what was kept."""
        kind = _KINDS[self.kind]
        return kind(**dict(zip(kind.__struct_fields__, self.values, strict=True)))


_decode = msgspec.msgpack.Decoder(_Entry).decode


@dataclass
class _Block:
    """Entries that are kept and dropped together. Only the newest of the blocks is added to."""

    began_s: float
    last_s: float
    size_bytes: int = 0
    entries: list[bytes] = field(default_factory=list)


class BlackBox:
    """Keeps what passed in the last `keep_s` seconds (0: nothing), and writes it.

    `header` builds the header of a log from its name; `say` tells the journal what was written.
    """

    def __init__(
        self,
        keep_s: float,
        folder: Path,
        header: Callable[[str], RunHeader],
        clocks: Clocks,
        say: Say,
    ) -> None:
        self.keep_s = keep_s
        self.path = ""
        """What was written last."""
        self._folder = folder / FOLDER
        self._header = header
        self._clocks = clocks
        self._say = say
        self._blocks: deque[_Block] = deque()
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
        self._keep(0, row, axis, stamp_s)

    def note(self, record: Event | LinkSample) -> None:
        """Keep something beside the samples."""
        self._keep(_KINDS.index(type(record)), record)

    def want(self, why: str) -> None:
        """Have it written soon, for this reason; what is written already is not written again."""
        if self._why or not self._blocks:
            return
        self._why = why
        self._due_s = max(self._now_s() + AFTERMATH_S, self._written_s + self.keep_s)

    @property
    def due(self) -> bool:
        """Whether what was wanted is to be written now."""
        return bool(self._why) and self._now_s() >= self._due_s

    async def write_wanted(self) -> None:
        """Write what was wanted; a disk that refuses is reported, and the daemon goes on."""
        self._why = ""
        try:
            await self.write(self.keep_s)
        except RunLogError as error:
            self._say(f"the last {self.keep_s:g} s could not be written: {error}")
        else:
            self._say(f"the last {self.keep_s:g} s are in {self.path}")

    async def write(self, seconds: float) -> int:
        """Write the last seconds into a log; return how many samples. Raises RunLogError."""
        now_s, before_s = self._now_s(), self._written_s
        blocks = [block.entries for block in self._blocks if block.last_s >= now_s - seconds]
        if blocks:
            blocks[-1] = blocks[-1].copy()
        loop = asyncio.get_running_loop()
        self._written_s = now_s
        try:
            path, rows = await loop.run_in_executor(
                self._worker, self._write, blocks, now_s - seconds, self._clocks.wall_s() - now_s
            )
        except RunLogError:
            self._written_s = before_s
            raise
        self.path = str(path)
        return rows

    def close(self) -> None:
        """Finish what is being written."""
        self._worker.shutdown(wait=True)

    def _now_s(self) -> float:
        return self._clocks.us() * 1e-6

    def _keep(
        self, kind: int, record: Record, axis: str = "", stamp_s: float | None = None
    ) -> None:
        if self.keep_s <= 0:
            return
        now_s = self._now_s()
        try:
            data = _encode(_Entry(kind, now_s, axis, stamp_s, astuple(record)))
        except (TypeError, ValueError, OverflowError):
            # The details of an event that no file could hold either.
            return
        block = self._block_for(now_s)
        block.entries.append(data)
        block.last_s = now_s
        block.size_bytes += len(data) + ENTRY_BYTES
        self._bytes += len(data) + ENTRY_BYTES
        while len(self._blocks) > 1 and (
            self._blocks[0].last_s < now_s - self.keep_s or self._bytes > MOST_BYTES
        ):
            self._bytes -= self._blocks.popleft().size_bytes

    def _block_for(self, now_s: float) -> _Block:
        """Return the block that takes an entry now."""
        newest = self._blocks[-1] if self._blocks else None
        if (
            newest is None
            or newest.size_bytes >= MOST_BYTES / _BLOCKS
            or now_s - newest.began_s >= self.keep_s / _BLOCKS
        ):
            newest = _Block(began_s=now_s, last_s=now_s)
            self._blocks.append(newest)
        return newest

    def _write(
        self, blocks: Sequence[Sequence[bytes]], since_s: float, epoch_s: float
    ) -> tuple[Path, int]:
        """Write what of these was kept since then; return where, and how many samples.

        `epoch_s` is the Unix time at which the daemon's clock was zero.
        """
        make_folder(self._folder)
        header = self._header("last")
        path = new_run_path(self._folder, "last", datetime.fromtimestamp(header.started_unix_s))
        entries = (_decode(data) for block in blocks for data in block)
        recent = (entry for entry in entries if entry.kept_s >= since_s)
        first = next(recent, None)
        if first is None:
            write_run(path, header, ())
            return path, 0
        began_s = epoch_s + first.kept_s if first.stamp_s is None else first.stamp_s
        rows = 0

        def records() -> Iterator[Record | tuple[Row, str, float]]:
            nonlocal rows
            for number, entry in enumerate(chain((first,), recent)):
                record = entry.record()
                if isinstance(record, Row) and entry.stamp_s is not None:
                    yield record, entry.axis, entry.stamp_s
                else:
                    yield record
                rows += isinstance(record, Row)
                if number % _ROWS_AT_ONCE == 0:
                    self._let_others_run.wait(_PAUSE_S)

        write_run(path, msgspec.structs.replace(header, started_unix_s=began_s), records())
        return path, rows
