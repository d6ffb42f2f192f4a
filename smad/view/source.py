"""The bench as all pages see it: samples into the feed, the status twice a second, who is there.

A client like any other. The telemetry is emptied thirty times a second instead of being awaited
sample by sample: the process wakes less often than samples come.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable

import msgspec
import zmq

from firmware_protocol.supervisor.limits import compiled_limits
from smad.api import TELEMETRY_TOPIC, Status
from smad.client import AsyncClient
from smad.client.wire import subscribe, telemetry_of
from smad.config import Config
from smad.config.load import parse_config
from smad.errors import SmadError
from smad.view import strips
from smad.view.errands import Mark
from smad.view.feed import FRAMES_PER_S, Feed
from smad.view.state import MODES, NO_WORD, Shown, shown

STATUS_EVERY_S = 0.5
PARAMS_EVERY = 10
"""The board's parameters are read once in so many statuses."""
RETRY_S = 0.5
SILENT_AFTER_S = 1.5
TIMEOUT_S = 2.0
MOST_MARKS = 200
_QUEUE = 2000
_TOPIC = TELEMETRY_TOPIC.encode()


class Source:
    """One bench, seen by any number of pages.

    `why_away` says in a line why the daemon cannot be reached, and is empty while it can.
    `version` grows with every status, and with every failure to get one. `log_path` is the run log
    that is written or was last, `folder` where run logs are; both are empty until a status came.
    """

    def __init__(self, bench: str, clock_s: Callable[[], float] = time.monotonic) -> None:
        self.bench = bench
        self.feed = Feed(len(strips.CHANNELS), strips.MOTION)
        self.marks: deque[Mark] = deque(maxlen=MOST_MARKS)
        self.marks_set = 0
        self.log_path = self.folder = ""
        self.log_first_s: float | None = None
        self.reference_mm = 0.0
        self.version = 0
        self.why_away = "the daemon has not answered yet"
        self.shown: Shown | None = None
        self.config = Config()
        self.now: tuple[float | None, ...] = ()
        self.mode: int | None = None
        self.clock_s = clock_s
        self._last_sample_s = clock_s()
        self._params: dict[str, float] = {}
        self._off_current_mA = float(compiled_limits().off_current_mA)

    @property
    def silent_s(self) -> float:
        """Seconds since the last sample, once they are too many; else 0."""
        silent = self.clock_s() - self._last_sample_s
        return silent if silent > SILENT_AFTER_S else 0.0

    @property
    def first_s(self) -> float | None:
        """Since when there is something to look back at; None while nothing has come."""
        return min(
            (t for t in (self.feed.first_s, self.log_first_s) if t is not None), default=None
        )

    def mark(self, text: str) -> None:
        """Mark the newest sample on the strips of all pages."""
        if self.now:
            self.marks.append(Mark(round(self.feed.last_s, 3), text))
            self.marks_set += 1

    @property
    def mode_name(self) -> str:
        """State of the board: that of the newest sample, as long as samples come."""
        if self.mode is not None and not self.silent_s:
            return MODES.get(self.mode, "")
        return "" if self.shown is None else self.shown.mode

    async def run(self) -> None:
        """Follow the bench for ever: connect, and connect again whenever the daemon is gone."""
        while True:
            try:
                async with AsyncClient(self.bench, timeout_s=TIMEOUT_S) as client:
                    await self._follow(client)
            except SmadError as error:
                self._away(str(error))
            await asyncio.sleep(RETRY_S)

    async def _follow(self, client: AsyncClient) -> None:
        self.config = parse_config(await client.config())
        self._last_sample_s = self.clock_s()
        async with asyncio.TaskGroup() as tasks:
            draining = tasks.create_task(self._drain(client.connection.telemetry))
            try:
                count = 0
                while True:
                    status = await client.status()
                    if count % PARAMS_EVERY == 0:
                        with contextlib.suppress(SmadError):
                            self._params = {p.name: p.value for p in await client.params()}
                    count += 1
                    self.seen(status)
                    await asyncio.sleep(STATUS_EVERY_S)
            except SmadError as error:
                self._away(str(error))
            finally:
                draining.cancel()

    def seen(self, status: Status) -> None:
        """Take over what the daemon says of itself."""
        self.shown = shown(status, self._params, self._off_current_mA)
        if self.shown.mode == NO_WORD:
            # The daemon missed the board sooner than we miss its samples.
            self.mode = None
        self.why_away = ""
        recorder, motion = status.recorder, status.motion
        if recorder.path != self.log_path:
            self.log_path, self.log_first_s = recorder.path, None
        self.folder = recorder.folder
        self.reference_mm = motion.reference_mm or motion.displacement_mm or 0.0
        self.version += 1

    def _away(self, why: str) -> None:
        self.why_away = why
        self.version += 1

    async def _drain(self, address: str) -> None:
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        socket = subscribe(context, address, _TOPIC, _QUEUE)
        try:
            while True:
                self._take_all(socket)
                await asyncio.sleep(1 / FRAMES_PER_S)
        finally:
            socket.close(linger=0)
            context.destroy(linger=0)

    def _take_all(self, socket: zmq.Socket[bytes]) -> None:
        for _ in range(_QUEUE):
            try:
                _, data = socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            with contextlib.suppress(msgspec.ValidationError):
                self._sample(data)

    def _sample(self, data: bytes) -> None:
        sample = telemetry_of(data)
        self.now, self.mode = strips.values(sample), sample.mode
        self._last_sample_s = self.clock_s()
        self.feed.add(sample.timestamp, self.now)
