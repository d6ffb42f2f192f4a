"""The sockets of the blocking client: no threads, no background work; every wait has a deadline."""

import time
from collections.abc import Generator
from typing import Any

import zmq
from msgspec import Struct

from smad.api import Telemetry, topic_of
from smad.client.endpoints import Connection
from smad.client.wire import (
    LOOK_S,
    Conversation,
    Keys,
    Reply,
    connect_both,
    ended,
    has_ended,
    no_answer,
    no_telemetry,
    require_open,
    subscribe,
    telemetry_of,
)

pause = time.sleep


class Channel:
    """Asks one daemon. It keeps working after a time-out: a late reply is known by its number."""

    def __init__(self, connection: Connection, keys: Keys | None) -> None:
        self.connection = connection
        self.conversation = Conversation()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._commands, self._stops = connect_both(self._context, connection, keys)

    def close(self) -> None:
        """Give the sockets back."""
        self._commands.close(linger=0)
        self._stops.close(linger=0)
        self._context.destroy(linger=0)

    def call(
        self,
        params: Struct,
        kind: type[Reply],
        limit_s: float,
        *,
        stop: bool,
        axes: str | tuple[str, ...] | None = None,
    ) -> Reply:
        """Return the reply to a request. Raises NoAnswer after `limit_s`, Refused, NoDaemon."""
        socket: Any = self._stops if stop else self._commands
        require_open(socket)
        call_id, data = self.conversation.request(params, axes)
        deadline_s = time.monotonic() + limit_s

        def wait_for(event: zmq.PollEvent) -> None:
            left_s = deadline_s - time.monotonic()
            while not socket.poll(max(1, int(min(left_s, LOOK_S) * 1000)), event):
                if ended(self.connection):
                    raise has_ended(self.connection)
                if (left_s := deadline_s - time.monotonic()) <= 0:
                    raise no_answer(self.connection, limit_s)

        wait_for(zmq.POLLOUT)
        try:
            socket.send(data, zmq.NOBLOCK)
        except zmq.Again:
            raise no_answer(self.connection, limit_s) from None
        while True:
            wait_for(zmq.POLLIN)
            reply = self.conversation.reply(socket.recv(), call_id, kind)
            if reply is not None:
                return reply

    def telemetry(self, limit_s: float, queue: int, axis: str) -> Generator[Telemetry]:
        """Published samples of an axis, as they come. Raises NoAnswer after `limit_s` without."""
        require_open(self._commands)
        topic = topic_of(axis).encode()
        socket = subscribe(self._context, self.connection.telemetry, topic, queue)
        try:
            while True:
                if not socket.poll(int(limit_s * 1000)):
                    raise no_telemetry(limit_s)
                yield telemetry_of(socket.recv_multipart()[1])
        finally:
            socket.close(linger=0)
