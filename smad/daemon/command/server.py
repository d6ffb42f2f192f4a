"""The command server: at most one message each time round the loop, stops first.

Before each message the serial port is looked at, so that a sample never waits for more than the
command in hand; and commands wait while the daemon uses more than a share of a core.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zmq

from smad.api import LARGEST_MESSAGE, LARGEST_TAKEN_IN, Reason
from smad.client.endpoints import Endpoints
from smad.config import DaemonConfig
from smad.daemon.command.auth import KeyAuthenticator, server_keys
from smad.daemon.command.remote import RemoteCounts, Routes, Socket, Source, TcpServer
from smad.daemon.command.rpc import error_reply
from smad.daemon.errors import Refusal
from smad.daemon.sockets.address import listen_local
from smad.daemon.sockets.descriptors import OPENED_LATER, Reserve, Shares, open_descriptors
from smad.daemon.sockets.listener import Connection, Hooks, Listener, Terms
from smad.daemon.sockets.zmtp import Broken, TooLong, encoded
from smad.errors import DaemonError, refused_by_system


class TimeBudget:
    """Fills with `share` of the passing time, up to `burst_ns`; the loop's work empties it.

    When it is empty, `delay_ns` says how long to wait before the next command: at most `most_ns`,
    so that commands are served, slowly, even if the rest of the loop needs more than the share.
    """

    def __init__(self, share: float, burst_ns: int, most_ns: int) -> None:
        self.share = share
        self.burst_ns = burst_ns
        self.most_ns = most_ns
        self._left_ns = float(burst_ns)
        self._seen: tuple[int, int] | None = None

    def look(self, now_ns: int, worked_ns: int) -> None:
        """Take in the time, and the processor time that the loop has used up to it."""
        if self._seen is not None:
            gained_ns = (now_ns - self._seen[0]) * self.share - (worked_ns - self._seen[1])
            floor_ns = -self.most_ns * self.share
            self._left_ns = min(max(self._left_ns + gained_ns, floor_ns), float(self.burst_ns))
        self._seen = now_ns, worked_ns

    def delay_ns(self) -> int:
        """Return how long to wait until the budget is positive again; 0 when it is now."""
        return 0 if self._left_ns > 0 else int(-self._left_ns / self.share) + 1


COMMAND_SHARE = 0.5
"""Of a core, for the whole loop: what a command costs is spread over it. The kernel stops a
real-time process that uses all of a core for 50 ms of each second (sched(7)); this is well below.
"""
COMMAND_BURST_NS = 5_000_000
COMMAND_DELAY_MOST_NS = 20_000_000

_CLIENTS = frozenset((b"DEALER", b"REQ", b"ROUTER"))
_STOP_QUEUE = 100
_STOP_STANDING_S, _COMMAND_STANDING_S = 0.05, 2.0
"""How long a silent client keeps its place while others wait. A stop is sent at once."""

_LOOK_NS = 100_000_000

Send = Callable[[bytes], None]
Handler = Callable[[bytes, bytes, Send, bool], None]
"""Takes the client's identity, its message, how to reply (at once or later), and whether the
message may have been sent before the last call of `mark`."""


@dataclass(frozen=True)
class Handlers:
    """What is done with a command, with a stop, and before every message."""

    command: Handler
    stop: Handler
    look_at_port: Callable[[], None]


class _Local:
    """The connections of one local channel, which take turns."""

    def __init__(self, serve: Callable[[Connection, list[bytes]], None]) -> None:
        self.ready: deque[Connection] = deque()
        self.listener: Listener
        self._serve = serve

    def serve_one(self) -> bool:
        while self.ready:
            connection = self.ready.popleft()
            if connection.message is None or connection.closed:
                continue
            self._serve(connection, connection.message)
            connection.advance()
            if connection.message is not None:
                self.ready.append(connection)
            return True
        return False

    def close(self) -> None:
        self.listener.close()


class CommandServer:
    """Commands and stops from this machine and, with keys, over TCP.

    `share` says how many may be connected at once.
    """

    def __init__(
        self,
        context: zmq.Context[Socket],
        handlers: Handlers,
        *,
        loop: asyncio.AbstractEventLoop,
        queue: int,
        reserve: Reserve = nullcontext,
    ) -> None:
        self.dropped_messages = 0
        """How many messages had another number of frames than a request has."""
        self.server_key = ""
        self._context = context
        self._loop = loop
        self._on_command = handlers.command
        self._on_stop = handlers.stop
        self._look_at_port = handlers.look_at_port
        self._queue = queue
        self._reserve = reserve
        self._budget = TimeBudget(COMMAND_SHARE, COMMAND_BURST_NS, COMMAND_DELAY_MOST_NS)
        self._served: list[_Local | Source] = []
        self._watched: list[Source] = []
        self._local: list[_Local] = []
        self._remote: TcpServer | None = None
        self._others = 0
        self._looked_ns = 0
        self._turning = False
        self._remote_behind = False

    @property
    def authenticator(self) -> KeyAuthenticator | None:
        """Who decides on keys; None without TCP."""
        return None if self._remote is None else self._remote.authenticator

    @property
    def remote_counts(self) -> RemoteCounts:
        """What happened over TCP."""
        return RemoteCounts() if self._remote is None else self._remote.counts

    @property
    def listeners(self) -> Iterator[Listener]:
        """The local channels: stops, commands."""
        return (local.listener for local in self._local)

    def serve_ipc(self, endpoints: Endpoints, umask: int) -> None:
        """Bind the ipc sockets. The bench's lock file must be held: a second bind would steal."""
        self._serve_local(endpoints.stop, umask, self._on_stop)
        self._serve_local(endpoints.command, umask, self._on_command)

    def serve_tcp(self, config: DaemonConfig, endpoints: Endpoints) -> tuple[str, str]:
        """Bind the TCP sockets, encrypted and for listed keys only; return their addresses."""
        tcp = config.tcp
        if not tcp.allowed_keys:
            raise DaemonError(
                "commands over TCP need a list of client keys",
                limit="CURVE with daemon.tcp.allowed_keys",
                action="list the clients' public keys, or leave daemon.tcp.enabled off",
            )
        if tcp.secret_key_file:
            public, secret = server_keys(Path(tcp.secret_key_file), follow=True)
        else:
            public, secret = server_keys(endpoints.server_secret)
        self.server_key = public.decode()
        self._remote = TcpServer(
            self._context,
            tcp,
            secret,
            Routes(
                command=lambda socket, frames: self._route(socket, frames, self._on_command),
                stop=lambda socket, frames: self._route(socket, frames, self._on_stop),
            ),
            queue=self._queue,
            reserve=self._reserve,
        )
        # Behind the local stops, before everything else.
        self._served[1:1] = self._remote.stops
        self._served += self._remote.sources
        self._watched = [*self._remote.stops, *self._remote.sources]
        for source in self._watched:
            self._loop.add_reader(source.descriptor, self.wake)
        self.wake()
        return f"tcp://{tcp.host}:{tcp.command_port}", f"tcp://{tcp.host}:{tcp.stop_port}"

    def share(self, shares: Shares) -> None:
        """Set how many may be connected at once."""
        for listener, most in zip(self.listeners, (shares.stop, shares.command), strict=False):
            listener.most = most
        if self._remote is not None:
            self._remote.most = shares.tcp
            self._others = open_descriptors() + OPENED_LATER

    def mark(self) -> None:
        """Note that commands which have not been read by now came before what happens now."""
        for listener in self.listeners:
            listener.mark()
        self._remote_behind = self._remote is not None

    def wake(self) -> None:
        """Look for messages. Needed after a send: ZeroMQ's descriptor is edge-triggered."""
        if self._remote is not None:
            self._count_connections(self._remote)
        if not self._turning and self._served:
            self._turning = True
            self._loop.call_soon(self._turn)

    def close(self) -> None:
        """Close every socket; replies on their way get a moment to leave."""
        for source in self._watched:
            with contextlib.suppress(ValueError, OSError):
                self._loop.remove_reader(source.descriptor)
        for local in self._local:
            local.close()
        if self._remote is not None:
            self._remote.close()
        self._served.clear()

    def _serve_local(self, address: str, umask: int, handler: Handler) -> None:
        stops = handler is self._on_stop

        def on_message(connection: Connection) -> None:
            local.ready.append(connection)
            self.wake()

        local = _Local(lambda connection, frames: self._answer(connection, frames, handler))
        action = "stop what uses the address, or choose another in the configuration"
        with refused_by_system(DaemonError, f"cannot listen on {address}", action=action):
            line = listen_local(address, umask)
        local.listener = Listener(
            self._loop,
            line,
            Terms(
                b"ROUTER",
                accepts=_CLIENTS,
                longest=LARGEST_TAKEN_IN,
                queue=_STOP_QUEUE if stops else self._queue,
                standing_s=_STOP_STANDING_S if stops else _COMMAND_STANDING_S,
            ),
            Hooks(on_message, _say_too_long, self._look_at_port),
            reserve=self._open_reserve if stops else nullcontext,
        )
        self._local.append(local)
        self._served.append(local)

    def _open_reserve(self) -> AbstractContextManager[Any]:
        return self._reserve() if self._remote is None else self._remote.reserve()

    def _count_connections(self, remote: TcpServer) -> None:
        now_ns = time.perf_counter_ns()
        if self._others and now_ns - self._looked_ns > _LOOK_NS:
            self._looked_ns = now_ns
            connections = self._others + sum(len(listener) for listener in self.listeners)
            remote.look(open_descriptors() - connections)

    def _turn(self) -> None:
        self._look_at_port()
        for served in self._served:
            if served.serve_one():
                self._go_on()
                return
        self._turning = False
        self._remote_behind = False

    def _go_on(self) -> None:
        self._budget.look(time.perf_counter_ns(), time.thread_time_ns())
        delay_ns = self._budget.delay_ns()
        if delay_ns:
            self._loop.call_later(delay_ns * 1e-9, self._turn)
        else:
            self._loop.call_soon(self._turn)

    def _answer(self, connection: Connection, frames: list[bytes], handler: Handler) -> None:
        split = self._split(frames)
        if split is None:
            return
        envelope, body = split

        def reply(data: bytes) -> None:
            # Lost where the client is gone, or does not read its replies.
            connection.send(encoded([*envelope, data]))

        handler(connection.identity, body, reply, connection.behind)

    def _route(self, socket: Socket, frames: list[bytes], handler: Handler) -> None:
        split = self._split(frames[1:])
        if split is None:
            return
        envelope, body = split

        def reply(data: bytes) -> None:
            with contextlib.suppress(zmq.ZMQError):
                socket.send_multipart([frames[0], *envelope, data], zmq.NOBLOCK)
            self.wake()

        handler(frames[0], body, reply, self._remote_behind)

    def _split(self, frames: list[bytes]) -> tuple[list[bytes], bytes] | None:
        # A REQ socket puts an empty frame before the message.
        if len(frames) == 2 and not frames[0]:
            return [b""], frames[1]
        if len(frames) == 1:
            return [], frames[0]
        self.dropped_messages += 1
        return None


def _say_too_long(connection: Connection, broken: Broken) -> None:
    if isinstance(broken, TooLong):
        refusal = Refusal(
            Reason.NO_REQUEST,
            f"{broken}; the connection is closed",
            limit=f"{LARGEST_MESSAGE} bytes",
            action="send it in pieces",
        )
        connection.send(encoded([error_reply(None, refusal)]))
