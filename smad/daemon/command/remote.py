"""Commands and stops from other machines: ZeroMQ over TCP, encrypted, for listed keys only.

Strangers are cheap to turn away but not free: each holds a descriptor for up to two seconds. So
the ports close to newcomers when too many connections are open, commands long before stops.
"""

import contextlib
import functools
import operator
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import zmq

from smad.api import LARGEST_TAKEN_IN
from smad.config import TcpConfig
from smad.daemon.command.auth import ZAP_ADDRESS, KeyAuthenticator
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.sockets.gate import Gate
from smad.errors import DaemonError

LAST_WORDS_MS = 200
"""How long a reply may take to leave when the daemon ends; clients that do not read lose it."""

_ZAP_DOMAIN = b"smad"
_HANDSHAKE_MS = 2000
_KEEP_ALIVE = (
    (zmq.TCP_KEEPALIVE, 1),
    (zmq.TCP_KEEPALIVE_IDLE, 60),
    (zmq.TCP_KEEPALIVE_INTVL, 10),
    (zmq.TCP_KEEPALIVE_CNT, 3),
)
"""A client whose machine or network is gone gives its place back after a minute and a half."""
_REOPENS_BELOW = 0.75

_COUNTED: dict[int, str] = {
    zmq.EVENT_ACCEPTED: "connections",
    zmq.EVENT_DISCONNECTED: "ended",
    zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL: "bad_handshakes",
}
"""Not the other two failures of a handshake: ZeroMQ 4.3.5 that has to tell of a message it cannot
decrypt forgets to end the connection, which then stays half open for good. Not that it could not
accept: without descriptors it says so a hundred thousand times a second."""

Socket = zmq.Socket[bytes]
Route = Callable[[Socket, list[bytes]], None]


@dataclass(frozen=True)
class Routes:
    """What is done with a message at each of the two ports."""

    command: Route
    stop: Route


@dataclass
class RemoteCounts:
    """What happened over TCP."""

    connections: int = 0
    ended: int = 0
    bad_handshakes: int = 0
    """Connections that did not greet in time."""
    shut: int = 0
    """How often a port was closed to newcomers."""


@dataclass
class Source:
    """A ZeroMQ socket that is read, and what is done with a message of it."""

    socket: Socket
    handle: Callable[[list[bytes]], None]
    monitored: bool = False
    admits: Callable[[str], bool] | None = None

    @property
    def descriptor(self) -> int:
        """What becomes readable when there may be a message. Edge-triggered."""
        return int(self.socket.getsockopt(zmq.FD))

    def serve_one(self) -> bool:
        """Handle one message; False if there is none."""
        try:
            frames = self.socket.recv_multipart(zmq.NOBLOCK, copy=False)
        except zmq.Again:
            return False
        # A key may have been struck off the list after its connection was let in.
        if self.admits is None or self.admits(str(frames[-1].get("User-Id"))):
            self.handle([frame.bytes for frame in frames])
        return True

    def close(self) -> None:
        """Close the socket; replies on their way get a moment to leave."""
        if self.monitored:
            self.socket.disable_monitor()
        self.socket.close(linger=LAST_WORDS_MS)


class TcpServer:
    """The two ports. `sources` are to be served: stops, who may enter, commands, what happened.

    Raises DaemonError when an address cannot be had.
    """

    def __init__(
        self,
        context: zmq.Context[Socket],
        config: TcpConfig,
        secret: bytes,
        routes: Routes,
        *,
        queue: int,
        reserve: Reserve,
    ) -> None:
        self.counts = RemoteCounts()
        self.authenticator = KeyAuthenticator(config.allowed_keys)
        self.most = 1024
        """Connections at once: commands get in while there are less than half as many."""
        self.stops: list[Source] = []
        self.sources: list[Source] = []
        self._context = context
        self._secret = secret
        self._reserve = reserve
        self._gates: list[tuple[Gate, float]] = []
        self._open = 0
        try:
            self._serve_authenticator()
            self.stops.append(self._serve(config.host, config.stop_port, routes.stop, queue, 1.0))
            self.sources.append(
                self._serve(config.host, config.command_port, routes.command, queue, 0.5)
            )
        except BaseException:
            self.close()
            raise

    def look(self, connections: int) -> None:
        """Take how many connections there really are; open and shut the ports accordingly."""
        self._open = connections
        self._set_gates()

    @contextlib.contextmanager
    def reserve(self) -> Iterator[None]:
        """Open the reserve of descriptors; who waits at the two ports cannot get them."""
        with contextlib.ExitStack() as stack:
            for gate, _ in self._gates:
                stack.enter_context(gate.hidden_from_zeromq())
            stack.enter_context(self._reserve())
            yield

    def close(self) -> None:
        """Close every socket.

        Those that are monitored go first: an event for which nobody listens any more would hold up
        ZeroMQ's own thread for good.
        """
        every = (*self.stops, *self.sources)
        for source in sorted(every, key=lambda source: not source.monitored):
            source.close()
        for gate, _ in self._gates:
            gate.close()

    def _set_gates(self) -> None:
        for gate, share in self._gates:
            most = self.most * share
            if self._open >= most:
                self.counts.shut += gate.is_open
                gate.shut(self.reserve)
            elif self._open < most * _REOPENS_BELOW:
                gate.open()

    def _serve(self, host: str, port: int, route: Route, queue: int, share: float) -> Source:
        address = f"tcp://{host}:{port}"
        socket = self._context.socket(zmq.ROUTER)
        options: Iterable[tuple[int, int | bytes]] = (
            (zmq.LINGER, 0),
            (zmq.MAXMSGSIZE, LARGEST_TAKEN_IN),
            (zmq.RCVHWM, queue),
            (zmq.SNDHWM, queue),
            (zmq.ROUTER_MANDATORY, 1),
            # Who comes back after the network was gone has its old name. The connection that it
            # had then may still look open from here, and must not make its stops unheard.
            (zmq.ROUTER_HANDOVER, 1),
            (zmq.HANDSHAKE_IVL, _HANDSHAKE_MS),
            *_KEEP_ALIVE,
            (zmq.CURVE_SERVER, 1),
            (zmq.CURVE_SECRETKEY, self._secret),
            (zmq.ZAP_DOMAIN, _ZAP_DOMAIN),
        )
        try:
            for option, value in options:
                socket.setsockopt(option, value)
            gate = Gate("" if host == "*" else host, port)
            self._gates.append((gate, share))
            self._monitor(socket)
            socket.setsockopt(zmq.USE_FD, gate.for_zeromq())
            socket.bind(address)
            gate.wait_until_taken_on()
        except (OSError, zmq.ZMQError) as error:
            socket.close(linger=0)
            raise DaemonError(
                f"cannot listen on {address}: {error.strerror}",
                action="stop what uses the address, or choose another in the configuration",
            ) from error
        return Source(
            socket,
            lambda frames: route(socket, frames),
            monitored=True,
            admits=self.authenticator.knows,
        )

    def _monitor(self, socket: Socket) -> None:
        events = self._context.socket(zmq.PAIR)
        events.setsockopt(zmq.LINGER, 0)
        # A full queue would hold up ZeroMQ's own thread, and every client with it.
        events.setsockopt(zmq.RCVHWM, 0)
        address = f"inproc://smad.events.{len(self._gates)}"
        socket.monitor(address, functools.reduce(operator.or_, _COUNTED))
        events.connect(address)
        self.sources.append(Source(events, self._count_event))

    def _count_event(self, frames: list[bytes]) -> None:
        name = _COUNTED.get(int.from_bytes(frames[0][:2], sys.byteorder))
        if name is None:
            return
        setattr(self.counts, name, getattr(self.counts, name) + 1)
        if name == "connections":
            self._open += 1
            self._set_gates()

    def _serve_authenticator(self) -> None:
        socket = self._context.socket(zmq.REP)
        socket.setsockopt(zmq.LINGER, 0)
        socket.bind(ZAP_ADDRESS)

        def answer(frames: list[bytes]) -> None:
            reply = self.authenticator.answer(frames)
            with contextlib.suppress(zmq.Again):
                socket.send_multipart(reply if reply is not None else [b""], zmq.NOBLOCK)

        self.sources.append(Source(socket, answer))
