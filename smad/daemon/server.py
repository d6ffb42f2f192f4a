"""The command server's sockets: at most one message each time round the loop, stops first.

Before each message the serial port is looked at, so that a sample never waits for more than the
command in hand; and all commands together may take only a share of the time.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import operator
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import zmq

from smad.api import LARGEST_MESSAGE
from smad.client.endpoints import Endpoints
from smad.config import DaemonConfig
from smad.daemon.auth import ZAP_ADDRESS, Doorkeeper, server_keys
from smad.daemon.budget import TimeBudget
from smad.errors import DaemonError

COMMAND_SHARE = 0.5
COMMAND_BURST_NS = 5_000_000
LAST_WORDS_MS = 200
"""How long a reply may take to leave when the daemon ends; clients that do not read lose it."""

_ZAP_DOMAIN = b"smad"
_HANDSHAKE_MS = 2000

_COUNTED: dict[int, str] = {
    zmq.EVENT_ACCEPTED: "connections",
    zmq.EVENT_DISCONNECTED: "ended",
    zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL: "bad_handshakes",
    zmq.EVENT_ACCEPT_FAILED: "not_accepted",
}
"""Not the other two failures of a handshake: ZeroMQ 4.3.5 that has to tell of a message it cannot
decrypt forgets to end the connection, which then stays half open for good."""

Socket = zmq.Socket[bytes]
Send = Callable[[bytes], None]
Handler = Callable[[bytes, bytes, Send], None]
"""Takes the client's identity, its message, and how to reply (at once or later)."""


@dataclass
class ServerCounts:
    """What came in and what could not be answered."""

    messages: int = 0
    dropped_replies: int = 0
    dropped_messages: int = 0
    connections: int = 0
    """Over TCP, as the next three."""
    ended: int = 0
    bad_handshakes: int = 0
    """Connections that did not greet in time."""
    not_accepted: int = 0
    """Connections that the system did not let in, usually for want of descriptors."""


@dataclass
class _Served:
    socket: Socket
    handle: Callable[[list[bytes]], None]
    monitored: bool = False
    descriptor: int = field(init=False)

    def __post_init__(self) -> None:
        self.descriptor = int(self.socket.getsockopt(zmq.FD))


class CommandServer:
    """ROUTER sockets for commands and for stops, on ipc and, with keys, on TCP.

    `look_at_port` runs before every message. `close()` ends it without lingering.
    """

    def __init__(
        self,
        context: zmq.Context[Socket],
        *,
        loop: asyncio.AbstractEventLoop,
        on_command: Handler,
        on_stop: Handler,
        look_at_port: Callable[[], None],
        queue: int,
        clock_ns: Callable[[], int] = time.perf_counter_ns,
    ) -> None:
        self.counts = ServerCounts()
        self.doorkeeper: Doorkeeper | None = None
        self.server_key = ""
        self._context = context
        self._loop = loop
        self._on_command = on_command
        self._on_stop = on_stop
        self._look_at_port = look_at_port
        self._queue = queue
        self._clock_ns = clock_ns
        self._budget = TimeBudget(COMMAND_SHARE, COMMAND_BURST_NS, clock_ns())
        self._served: list[_Served] = []
        self._turning = False

    def serve_ipc(self, endpoints: Endpoints, umask: int) -> None:
        """Bind the ipc sockets. The bench's lock file must be held: a second bind would steal."""
        previous = os.umask(umask)
        try:
            self._add(self._router(self._on_stop), endpoints.stop, self._on_stop, first=True)
            self._add(self._router(self._on_command), endpoints.command, self._on_command)
        finally:
            os.umask(previous)

    def serve_tcp(self, config: DaemonConfig, endpoints: Endpoints) -> tuple[str, str]:
        """Bind the TCP sockets, encrypted and for listed keys only; return their addresses."""
        tcp = config.tcp
        if not tcp.allowed_keys:
            raise DaemonError(
                "commands over TCP need a list of client keys",
                limit="CURVE with daemon.tcp.allowed_keys",
                action="list the clients' public keys, or leave daemon.tcp.enabled off",
            )
        path = endpoints.server_secret
        if tcp.secret_key_file:
            path = type(path)(tcp.secret_key_file)
        public, secret = server_keys(path)
        self.server_key = public.decode()
        self.doorkeeper = Doorkeeper(tcp.allowed_keys)
        self._serve_doorkeeper(self.doorkeeper)
        addresses = []
        for port, handler in ((tcp.command_port, self._on_command), (tcp.stop_port, self._on_stop)):
            socket = self._router(handler)
            socket.setsockopt(zmq.CURVE_SERVER, 1)
            socket.setsockopt(zmq.CURVE_SECRETKEY, secret)
            socket.setsockopt(zmq.ZAP_DOMAIN, _ZAP_DOMAIN)
            address = f"tcp://{tcp.host}:{port}"
            self._add(socket, address, handler, first=handler is self._on_stop)
            addresses.append(address)
        return addresses[0], addresses[1]

    def wake(self) -> None:
        """Look for messages. Needed after a send: ZeroMQ's descriptor is edge-triggered."""
        if not self._turning and self._served:
            self._turning = True
            self._loop.call_soon(self._turn)

    def close(self) -> None:
        """Close every socket; replies on their way get a moment to leave."""
        for served in self._served:
            with contextlib.suppress(ValueError, OSError):
                self._loop.remove_reader(served.descriptor)
            if served.monitored:
                served.socket.disable_monitor()
            served.socket.close(linger=LAST_WORDS_MS)
        self._served.clear()

    def _router(self, handler: Handler) -> Socket:
        socket = self._context.socket(zmq.ROUTER)
        stops = handler is self._on_stop
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.MAXMSGSIZE, LARGEST_MESSAGE)
        socket.setsockopt(zmq.RCVHWM, 100 if stops else self._queue)
        socket.setsockopt(zmq.SNDHWM, 100 if stops else self._queue)
        socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
        socket.setsockopt(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
        return socket

    def _add(self, socket: Socket, address: str, handler: Handler, *, first: bool = False) -> None:
        try:
            socket.bind(address)
        except zmq.ZMQError as error:
            socket.close(linger=0)
            raise DaemonError(
                f"cannot listen on {address}: {error.strerror}",
                action="stop what uses the address, or choose another in the configuration",
            ) from error
        tcp = address.startswith("tcp:")
        if tcp:
            self._monitor(socket)
        self._watch(
            _Served(socket, lambda frames: self._route(socket, frames, handler), monitored=tcp),
            first=first,
        )

    def _monitor(self, socket: Socket) -> None:
        events = self._context.socket(zmq.PAIR)
        events.setsockopt(zmq.LINGER, 0)
        # A full queue would hold up ZeroMQ's own thread, and every client with it.
        events.setsockopt(zmq.RCVHWM, 0)
        address = f"inproc://smad.events.{len(self._served)}"
        socket.monitor(address, functools.reduce(operator.or_, _COUNTED))
        events.connect(address)
        self._watch(_Served(events, self._count_event), first=False)

    def _count_event(self, frames: list[bytes]) -> None:
        name = _COUNTED.get(int.from_bytes(frames[0][:2], sys.byteorder))
        if name is not None:
            setattr(self.counts, name, getattr(self.counts, name) + 1)

    def _serve_doorkeeper(self, doorkeeper: Doorkeeper) -> None:
        socket = self._context.socket(zmq.REP)
        socket.setsockopt(zmq.LINGER, 0)
        socket.bind(ZAP_ADDRESS)

        def answer(frames: list[bytes]) -> None:
            reply = doorkeeper.answer(frames)
            socket.send_multipart(reply if reply is not None else [b""], zmq.NOBLOCK)

        self._watch(_Served(socket, answer), first=False)

    def _watch(self, served: _Served, *, first: bool) -> None:
        self._served.insert(0 if first else len(self._served), served)
        self._loop.add_reader(served.descriptor, self.wake)
        self.wake()

    def _turn(self) -> None:
        self._look_at_port()
        for served in self._served:
            try:
                frames = served.socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                continue
            began_ns = self._clock_ns()
            self.counts.messages += 1
            served.handle(frames)
            self._budget.spend(began_ns, self._clock_ns())
            self._go_on()
            return
        self._turning = False

    def _go_on(self) -> None:
        delay_ns = self._budget.delay_ns()
        if delay_ns:
            self._loop.call_later(delay_ns * 1e-9, self._turn)
        else:
            self._loop.call_soon(self._turn)

    def _route(self, socket: Socket, frames: list[bytes], handler: Handler) -> None:
        # A REQ socket puts an empty frame between its identity and the message.
        envelope = frames[:2] if len(frames) == 3 and not frames[1] else frames[:1]
        body = frames[len(envelope) :]
        if len(body) != 1:
            self.counts.dropped_messages += 1
            return

        def reply(data: bytes) -> None:
            try:
                socket.send_multipart([*envelope, data], zmq.NOBLOCK)
            except zmq.ZMQError:
                # The client is gone, or does not read its replies.
                self.counts.dropped_replies += 1
            self.wake()

        handler(envelope[0], body[0], reply)
