"""The sockets of the client for asyncio; every wait has a deadline."""

import asyncio
from collections.abc import AsyncGenerator
from typing import Any

import zmq.asyncio
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

pause = asyncio.sleep


class AsyncChannel:
    """Asks one daemon, one call after the other: a late reply is known by its number."""

    def __init__(self, connection: Connection, keys: Keys | None) -> None:
        self.connection = connection
        self.conversation = Conversation()
        # The stop channel has a turn of its own: a stop never waits behind a command.
        self._turn = {False: asyncio.Lock(), True: asyncio.Lock()}
        self._context = zmq.asyncio.Context()
        self._commands, self._stops = connect_both(self._context, connection, keys)

    def close(self) -> None:
        """Give the sockets back."""
        self._commands.close(linger=0)
        self._stops.close(linger=0)
        self._context.destroy(linger=0)

    async def call(
        self,
        params: Struct,
        kind: type[Reply],
        limit_s: float,
        *,
        stop: bool,
        axes: str | tuple[str, ...] | None = None,
    ) -> Reply:
        """Return the reply to a request. Raises NoAnswer after `limit_s`, Refused, NoDaemon."""
        socket = self._stops if stop else self._commands
        require_open(socket)
        # Before it waits for its turn: a stop that comes meanwhile is not known to who asks.
        call_id, data = self.conversation.request(params, axes)
        async with self._turn[stop]:
            try:
                async with asyncio.timeout(limit_s):
                    await self._wait_for(socket, zmq.POLLOUT)
                    await socket.send(data)
                    while True:
                        await self._wait_for(socket, zmq.POLLIN)
                        reply = self.conversation.reply(await socket.recv(), call_id, kind)
                        if reply is not None:
                            return reply
            except TimeoutError:
                raise no_answer(self.connection, limit_s) from None

    async def _wait_for(self, socket: Any, event: zmq.PollEvent) -> None:
        while not await socket.poll(int(LOOK_S * 1000), event):
            if ended(self.connection):
                raise has_ended(self.connection)

    async def telemetry(self, limit_s: float, queue: int, axis: str) -> AsyncGenerator[Telemetry]:
        """Published samples of an axis, as they come. Raises NoAnswer after `limit_s` without."""
        require_open(self._commands)
        topic = topic_of(axis).encode()
        socket = subscribe(self._context, self.connection.telemetry, topic, queue)
        try:
            while True:
                if not await socket.poll(int(limit_s * 1000)):
                    raise no_telemetry(limit_s)
                yield telemetry_of((await socket.recv_multipart())[1])
        finally:
            socket.close(linger=0)
