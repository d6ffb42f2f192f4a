"""The stream for viewers: two frames a message, as a ZeroMQ PUB socket sends it, never waited for.

A subscriber that does not read loses samples; the sequence number shows it, and the loop does not.
"""

import asyncio

import msgspec

from smad.api import topic_of
from smad.config import TelemetryConfig
from smad.daemon.sockets.address import listen_at
from smad.daemon.sockets.listener import Hooks, Listener, Terms
from smad.daemon.sockets.zmtp import encoded
from smad.errors import DaemonError, refused_by_system
from smad.runlog.schema import Row

_VIEWERS = frozenset((b"SUB", b"XSUB"))
_LONGEST = 256
"""Bytes of a subscription."""


class _Stream:
    """The samples of one axis: how many there were, how many were published, under which topic."""

    def __init__(self, axis: str) -> None:
        self.topic = topic_of(axis).encode()
        self.count = 0
        self.sequence = 0


class Publisher:
    """Publishes every nth sample on ipc, and on the configured address where that is free.

    `note` says why the configured address is not served, or is empty. `dropped` counts samples
    that a viewer did not take in time.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        config: TelemetryConfig,
    ) -> None:
        self.dropped = 0
        self.note = ""
        self.listeners: list[Listener] = []
        self._loop = loop
        self._every = config.every_nth_sample
        self._queue = config.high_water_mark
        self._streams: dict[str, _Stream] = {}
        self._encoder = msgspec.json.Encoder()

    def bind_ipc(self, address: str, umask: int) -> None:
        """Serve the bench's own address. Raises DaemonError."""
        action = "check the folder, or set daemon.ipc_dir"
        with refused_by_system(DaemonError, f"cannot listen on {address}", action=action):
            self._bind(address, umask)

    def bind_extra(self, address: str, umask: int) -> None:
        """Serve another address; a refusal is noted, not raised: viewing is not worth stopping."""
        try:
            self._bind(address, umask)
        except OSError as error:
            self.note = (
                f"telemetry is not on {address} ({error.strerror}): another bench may use it; "
                "set telemetry.endpoint"
            )

    def share(self, most: int) -> None:
        """Set how many viewers there may be at once."""
        for listener in self.listeners:
            listener.most = max(1, most // len(self.listeners))

    def publish(self, row: Row, timestamp: float, axis: str = "") -> None:
        """Send one sample if it is its turn; never blocks, never raises for a slow subscriber."""
        stream = self._streams.get(axis)
        if stream is None:
            stream = self._streams[axis] = _Stream(axis)
        stream.count += 1
        if stream.count % self._every:
            return
        stream.sequence += 1
        data = b""
        for listener in self.listeners:
            for viewer in listener:
                if not any(stream.topic.startswith(topic) for topic in viewer.topics):
                    continue
                data = data or self._encoded(row, timestamp, stream)
                if not viewer.send(data):
                    self.dropped += 1

    def _encoded(self, row: Row, timestamp: float, stream: _Stream) -> bytes:
        # The row's own JSON with two fields put in front: what `api.Telemetry` describes, without
        # copying thirty fields for each sample.
        payload = b'{"timestamp":%.6f,"sequence":%d,%b' % (
            timestamp,
            stream.sequence,
            self._encoder.encode(row)[1:],
        )
        return encoded((stream.topic, payload))

    def close(self) -> None:
        """Stop serving."""
        for listener in self.listeners:
            listener.close()

    def _bind(self, address: str, umask: int) -> None:
        listener = Listener(
            self._loop,
            listen_at(address, umask),
            Terms(b"PUB", accepts=_VIEWERS, longest=_LONGEST, queue=self._queue),
            Hooks(),
        )
        self.listeners.append(listener)
