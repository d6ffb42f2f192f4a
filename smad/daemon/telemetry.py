"""The stream for viewers: a ZeroMQ PUB socket, two frames a message, never waited for.

A subscriber that does not read loses samples; the sequence number shows it, and the loop does not.
"""

from __future__ import annotations

import contextlib

import msgspec
import zmq

from smad.api import TELEMETRY_TOPIC
from smad.config import TelemetryConfig
from smad.runlog.schema import Row

_TOPIC = TELEMETRY_TOPIC.encode()


class Publisher:
    """Publishes every nth sample on ipc, and on the configured address where that is free.

    Linger is 0, so that the daemon ends at once whoever is listening. `note` says why the
    configured address is not served, or is empty.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], config: TelemetryConfig) -> None:
        self.sequence = 0
        self.dropped = 0
        self.note = ""
        self.addresses: list[str] = []
        self._every = config.every_nth_sample
        self._count = 0
        self._encoder = msgspec.json.Encoder()
        self._socket = context.socket(zmq.PUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.SNDHWM, config.high_water_mark)

    def bind_ipc(self, address: str) -> None:
        """Serve the bench's own address."""
        self._socket.bind(address)
        self.addresses.append(address)

    def bind_extra(self, address: str) -> None:
        """Serve another address; a refusal is noted, not raised: viewing is not worth stopping."""
        try:
            self._socket.bind(address)
        except zmq.ZMQError as error:
            self.note = (
                f"telemetry is not on {address} ({error.strerror}): another bench may use it; "
                "set telemetry.endpoint"
            )
        else:
            self.addresses.append(address)

    def publish(self, row: Row, timestamp: float) -> None:
        """Send one sample if it is its turn; never blocks, never raises for a slow subscriber."""
        self._count += 1
        if self._count % self._every:
            return
        self.sequence += 1
        # The row's own JSON with two fields put in front: what `api.Telemetry` describes, without
        # copying thirty fields for each sample.
        payload = b'{"timestamp":%.6f,"sequence":%d,%b' % (
            timestamp,
            self.sequence,
            self._encoder.encode(row)[1:],
        )
        try:
            self._socket.send_multipart((_TOPIC, payload), zmq.NOBLOCK, copy=True)
        except zmq.Again:
            self.dropped += 1

    def close(self) -> None:
        """Stop serving."""
        with contextlib.suppress(zmq.ZMQError):
            self._socket.close(linger=0)
