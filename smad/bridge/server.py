"""The viewers: a WebSocket for each, a bounded queue of data for each. Loopback only."""

import asyncio
import contextlib
import functools
import time
from collections import deque
from collections.abc import AsyncIterator, Iterable
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, ConnectionClosedError
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from smad.bridge.foxglove import ERROR, LOG, SUBPROTOCOLS, WARNING, Channel, Viewer, log, status
from smad.bridge.loopback import HOST, listen, quiet
from smad.bridge.source import Source
from smad.counted import counted
from smad.progress import Say, silent

MOST_VIEWERS = 8
MOST_WAITING = 2000
"""Messages that wait for a viewer: four seconds at 500 Hz. Then the oldest goes."""
LARGEST_MESSAGE = 65_536
"""Bytes that a viewer may send at once."""
CLOSING_S = 1.0
LONGEST_SEND_S = 5.0
"""A viewer that takes nothing for so long is let go, and its place is free."""
MOST_UNREAD = 262_144
"""Bytes that may wait in a connection before a send waits for its viewer."""


class ViewerConnection:
    """A viewer and the data that waits for it. `lost` counts what was dropped."""

    def __init__(self, connection: ServerConnection, viewer: Viewer) -> None:
        self.viewer = viewer
        self.lost = 0
        self._connection = connection
        self._waiting: deque[bytes] = deque()
        self._filled = asyncio.Event()
        self._reported = 0

    async def read(self) -> None:
        """Answer the viewer until it goes away."""
        for text in self.viewer.hello():
            await self._send(text)
        async for message in self._connection:
            if isinstance(message, str):
                for answer in self.viewer.receive(message):
                    await self._send(answer)

    async def write(self) -> None:
        """Send what waits, until the viewer goes away."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._filled.wait()
                self._filled.clear()
                while self._waiting:
                    await self._send(self._waiting.popleft())

    async def _send(self, message: str | bytes) -> None:
        """Send a message; raise ConnectionClosed for a viewer that does not read."""
        try:
            async with asyncio.timeout(LONGEST_SEND_S):
                await self._connection.send(message)
        except TimeoutError:
            # No closing handshake: who reads nothing reads that neither.
            self._connection.transport.abort()
            raise ConnectionClosedError(None, None) from None

    def enqueue(self, messages: Iterable[bytes]) -> None:
        """Let messages wait; of too many the oldest are dropped."""
        for message in messages:
            if len(self._waiting) >= MOST_WAITING:
                self._waiting.popleft()
                self.lost += 1
            self._waiting.append(message)
            self._filled.set()

    async def report(self, why_away: str) -> None:
        """Tell the user of the viewer why nothing comes, and what was dropped since last time."""
        messages: list[str | bytes] = [*self.viewer.changed()]
        if why_away:
            messages.append(status(ERROR, why_away))
        if self.lost > self._reported:
            lost, self._reported = self.lost - self._reported, self.lost
            messages.append(
                status(WARNING, f"{counted(lost, 'message')} dropped: this viewer reads too slowly")
            )
        with contextlib.suppress(ConnectionClosed):
            for message in messages:
                await self._send(message)


class Bridge:
    """Passes a bench on to viewers. `address` is what they connect to."""

    def __init__(self, source: Source, port: int, say: Say = silent) -> None:
        self.address = f"ws://{HOST}:{port}"
        self._source = source
        self._say = say
        self._session = str(time.time_ns())
        self._viewers: set[ViewerConnection] = set()
        self._reporting: dict[ViewerConnection, asyncio.Task[None]] = {}
        self._away = ""

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse a viewer too many (a response), or let it in (None)."""
        if len(self._viewers) < MOST_VIEWERS:
            return None
        text = f"{MOST_VIEWERS} viewers are connected.\n"
        return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, text)

    async def talk(self, connection: ServerConnection) -> None:
        """Serve one viewer."""
        viewer = Viewer(
            self._source.bench,
            self._session,
            lambda: self._source.channels,
            lambda: self._source.parameters,
            self._history,
        )
        viewer_connection = ViewerConnection(connection, viewer)
        self._viewers.add(viewer_connection)
        writing = asyncio.create_task(viewer_connection.write())
        try:
            if self._away:
                await viewer_connection.report(self._away)
            await viewer_connection.read()
        except ConnectionClosed:
            pass
        finally:
            self._viewers.discard(viewer_connection)
            writing.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionClosed):
                await writing

    def _history(self, channel: Channel) -> list[tuple[int, bytes]]:
        events = self._source.events if channel == LOG else ()
        return [log(entry.time_s, entry.kind, entry.text) for entry in events]

    def wants(self, channel: Channel) -> bool:
        """Whether a viewer subscribed to the channel."""
        return any(viewer_connection.viewer.wants(channel) for viewer_connection in self._viewers)

    def publish(self, channel: Channel, time_ns: int, body: bytes) -> None:
        """Let a message wait for each viewer that subscribed to its channel."""
        for viewer_connection in self._viewers:
            viewer_connection.enqueue(viewer_connection.viewer.messages(channel, time_ns, body))

    def _on_reported(self, viewer_connection: ViewerConnection, _: asyncio.Task[None]) -> None:
        del self._reporting[viewer_connection]

    def announce(self, why_away: str) -> None:
        """Tell the viewers of new parameters, of losses, and once why the bench is away."""
        again = why_away == self._away
        self._away = why_away
        if why_away and not again:
            self._say(why_away)
        for viewer_connection in tuple(self._viewers):
            # A viewer that has not taken the last one gets the next when it has.
            if viewer_connection not in self._reporting:
                task = asyncio.create_task(viewer_connection.report("" if again else why_away))
                self._reporting[viewer_connection] = task
                task.add_done_callback(functools.partial(self._on_reported, viewer_connection))


@contextlib.asynccontextmanager
async def serving(bench: str, port: int, say: Say = silent) -> AsyncIterator[Bridge]:
    """Serve viewers as long as the block lasts. Port 0: any free one. Raises ConfigError.

    `say` is told why nothing comes from the bench.
    """
    listening = listen(port)
    source = Source(bench)
    bridge = Bridge(source, listening.getsockname()[1], say)
    async with serve(
        bridge.talk,
        sock=listening,
        process_request=bridge.admit,
        subprotocols=[Subprotocol(name) for name in SUBPROTOCOLS],
        compression=None,
        max_size=LARGEST_MESSAGE,
        write_limit=MOST_UNREAD,
        close_timeout=CLOSING_S,
        server_header=None,
        logger=quiet("smad.bridge.strangers"),
    ):
        following = asyncio.create_task(source.run(bridge))
        try:
            yield bridge
        finally:
            following.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await following
