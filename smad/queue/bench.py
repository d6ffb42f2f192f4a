"""The bench as the runner sees it: a client that only looks, and never waits long."""

import contextlib
from collections.abc import Callable
from typing import Any

import msgspec
import zmq
from msgspec import Struct

from smad import api
from smad.api import AXIS_TOPICS, TELEMETRY_TOPIC
from smad.client import Client
from smad.client.wire import subscribe, telemetry_of
from smad.errors import SmadError
from smad.queue.machine import Readiness
from smad.queue.meter import Meter
from smad.queue.states import Usage

TIMEOUT_S = 0.5
_STATUS_EVERY_S = 0.5
_QUEUE = 4000
_BUSY = ("ARMED", "HOLD", "COOL")
_TROUBLE = ("FAULT", "ESTOP")


class BenchSnapshot(Struct, frozen=True, kw_only=True):
    """What a look showed. `generation` is None while no daemon answers."""

    generation: int | None = None
    bench: Readiness = Readiness(False, "no daemon answers")
    recording: str = ""
    """The run log that is being written, or was written last."""
    being_recorded: bool = False
    folder: str = ""


class BenchWatch:
    """Looks at a bench twice a second, and meters what it uses; connects again by itself."""

    def __init__(self, bench: str, *, clock_s: Callable[[], float]) -> None:
        self._bench = bench
        self._clock_s = clock_s
        self._client: Client | None = None
        self._context: zmq.Context[Any] | None = None
        self._socket: Any = None
        self._meters: dict[bytes, Meter] = {}
        self._view = BenchSnapshot()
        self._looked_s = -1e9

    def look(self, *, now: bool = False) -> BenchSnapshot:
        """Return how the bench is; `now` asks it, else what is half a second old may do."""
        if now or self._clock_s() - self._looked_s >= _STATUS_EVERY_S:
            self._view = self._query_daemon()
            self._looked_s = self._clock_s()
        return self._view

    def usage(self) -> Usage:
        """Return the energy and the cycles since the last call."""
        self._drain()
        return sum((meter.take_usage() for meter in self._meters.values()), Usage())

    def stop_recording(self) -> None:
        """Close the run log of an item that was killed. Raises SmadError."""
        with Client(self._bench, timeout_s=10.0) as client:
            client.stop_recording()

    def close(self) -> None:
        """Give the sockets back."""
        if self._client is not None:
            self._client.close()
        if self._socket is not None:
            self._socket.close(linger=0)
        if self._context is not None:
            self._context.destroy(linger=0)
        self._client = self._socket = self._context = None

    def _query_daemon(self) -> BenchSnapshot:
        try:
            if self._client is None:
                self._client = Client(self._bench, timeout_s=TIMEOUT_S)
                if address := self._client.connection.telemetry:
                    self._subscribe(address)
            return _snapshot_of(self._client.status())
        except SmadError:
            # A daemon that comes up again has other sockets.
            self.close()
            return BenchSnapshot()

    def _subscribe(self, address: str) -> None:
        self._context = zmq.Context()
        self._socket = subscribe(self._context, address, b"", _QUEUE)
        self._meters = {}

    def _drain(self) -> None:
        if self._socket is None:
            return
        with contextlib.suppress(zmq.Again):
            while True:
                topic, data = self._socket.recv_multipart(zmq.NOBLOCK)
                if topic == TELEMETRY_TOPIC.encode() or topic.startswith(AXIS_TOPICS.encode()):
                    with contextlib.suppress(msgspec.ValidationError):
                        self._meters.setdefault(topic, Meter()).sample(telemetry_of(data))


def _snapshot_of(status: api.Status) -> BenchSnapshot:
    motion = status.motion
    modes = {part.motion.mode for part in status.parts().values()}
    trouble = ""
    if motion.fault is not None:
        trouble = f"the bench has a fault: {motion.fault.name}"
    elif modes & set(_TROUBLE):
        trouble = f"the board is in {', '.join(sorted(modes))}"
    elif status.board is None:
        trouble = "the board does not answer"
    busy = bool(modes & set(_BUSY)) or bool(status.control.holder)
    return BenchSnapshot(
        generation=motion.generation,
        bench=Readiness(not trouble and not busy, trouble),
        recording=status.recorder.path,
        being_recorded=status.recorder.recording,
        folder=status.recorder.folder,
    )
