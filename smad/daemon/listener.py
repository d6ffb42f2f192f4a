"""Connections that speak ZeroMQ without encryption, held by the daemon's own loop.

ZeroMQ's own listener ends the process when descriptors run out. This one takes in so many
connections and no more; who comes later waits in the kernel's queue until a place is free.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import secrets
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import nullcontext

from smad.daemon.descriptors import Reserve
from smad.daemon.zmtp import GREETING, Broken, Greeted, Message, Peer, Reply, Subscription, ready

HANDSHAKE_S = 2.0
_PIECE = 65_536
_BACKLOG = 128
_RETRY_S = 0.1
_MOST_TOPICS = 100


class Connection:
    """One peer. What it sends is taken by `next_message`; what it is sent may have to wait."""

    def __init__(self, listener: Listener, line: socket.socket) -> None:
        self.identity = b""
        self.topics: list[bytes] = []
        self.greeted = False
        self.message: list[bytes] | None = None
        self.heard_s = listener.loop.time()
        self.closed = False
        self._listener = listener
        self._line = line
        self._peer = listener.peer()
        self._outbox: deque[bytes] = deque()
        self._paused = False
        self._deadline = listener.loop.call_later(HANDSHAKE_S, self.close)
        listener.loop.add_reader(line, self._on_readable)
        self._push(GREETING)

    def send(self, data: bytes) -> bool:
        """Send encoded bytes; False if the peer is gone or has too much unread. Never waits."""
        if self.closed or len(self._outbox) >= self._listener.queue:
            return False
        self._push(data)
        return not self.closed

    def advance(self) -> None:
        """Look for the next message; it is then in `message`, or None."""
        self.message = None
        try:
            while self.message is None and (taken := self._peer.take()) is not None:
                self._take(taken)
        except Broken as broken:
            self._listener.on_broken(self, broken)
            self.close()
        else:
            if self._paused and self._peer.waiting < _PIECE and self.message is None:
                self._paused = False
                self._listener.loop.add_reader(self._line, self._on_readable)

    def close(self) -> None:
        """End it; what the kernel has taken still arrives."""
        if self.closed:
            return
        self.closed = True
        self._deadline.cancel()
        loop = self._listener.loop
        loop.remove_reader(self._line)
        loop.remove_writer(self._line)
        self._line.close()
        self._listener.forget(self)

    def _take(self, taken: Greeted | Message | Subscription | Reply) -> None:
        match taken:
            case Message(frames):
                self.message = frames
            case Greeted(identity):
                self.greeted = True
                self._deadline.cancel()
                self.identity = self._listener.name(self, identity)
                self._push(ready(self._listener.kind))
            case Subscription(topic, True):
                if len(self.topics) >= _MOST_TOPICS:
                    raise Broken("too many subscriptions")
                self.topics.append(topic)
            case Subscription(topic, False):
                with contextlib.suppress(ValueError):
                    self.topics.remove(topic)
            case Reply(data):
                self.send(data)

    def _on_readable(self) -> None:
        if self.message is not None:
            # Nothing is read ahead of a message that has not been taken.
            self._paused = True
            self._listener.loop.remove_reader(self._line)
            return
        self._listener.before_reading()
        try:
            data = self._line.recv(_PIECE)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if not data:
            self.close()
            return
        self._listener.heard(self)
        self._peer.receive(data)
        self.advance()
        if self.message is not None:
            self._listener.on_message(self)

    def _push(self, data: bytes) -> None:
        if not self._outbox:
            try:
                sent = self._line.send(data)
            except (BlockingIOError, InterruptedError):
                sent = 0
            except OSError:
                # Closed later: whoever sends may be walking through all connections.
                self._listener.loop.call_soon(self.close)
                return
            if sent == len(data):
                return
            data = data[sent:]
            self._listener.loop.add_writer(self._line, self._on_writable)
        self._outbox.append(data)

    def _on_writable(self) -> None:
        try:
            while self._outbox:
                sent = self._line.send(self._outbox[0])
                if sent < len(self._outbox[0]):
                    self._outbox[0] = self._outbox[0][sent:]
                    return
                self._outbox.popleft()
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            self.close()
            return
        self._listener.loop.remove_writer(self._line)


class Listener:
    """Takes connections at one address, at most `most` at once, as a ZeroMQ socket of `kind`.

    `on_message` is told when a connection has a message and had none before. When all places are
    taken, the peer that has been silent for longest gives its place to one that waits, if that
    was for `standing_s`. (ZeroMQ's clients connect again by themselves when they have to say
    something.)
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        line: socket.socket,
        kind: bytes,
        *,
        accepts: frozenset[bytes],
        longest: int,
        queue: int,
        on_message: Callable[[Connection], None] = lambda connection: None,
        on_broken: Callable[[Connection, Broken], None] = lambda connection, broken: None,
        before_reading: Callable[[], None] = lambda: None,
        most: int = 256,
        standing_s: float = math.inf,
        reserve: Reserve = nullcontext,
    ) -> None:
        self.loop = loop
        self.kind = kind
        self.queue = queue
        self.on_message = on_message
        self.on_broken = on_broken
        self.before_reading = before_reading
        self.most = most
        self.kept_waiting = 0
        """How often somebody had to wait because all places were taken, or no descriptor was."""
        self.displaced = 0
        self._accepts = accepts
        self._longest = longest
        self._standing_s = standing_s
        self._reserve = reserve
        self._line = line
        # In the order in which they were last heard.
        self._connections: dict[Connection, None] = {}
        self._names: dict[bytes, Connection] = {}
        self._listening = False
        self._retry: asyncio.TimerHandle | None = None
        self._closed = False
        line.setblocking(False)
        self._listen()

    def __iter__(self) -> Iterator[Connection]:
        return iter(self._connections)

    def __len__(self) -> int:
        return len(self._connections)

    def peer(self) -> Peer:
        """Return the protocol's side of a new connection."""
        return Peer(self._accepts, self._longest, publishes=self.kind == b"PUB")

    def name(self, connection: Connection, wanted: bytes) -> bytes:
        """Return the name a connection goes by. Raises Broken when another one has it."""
        if wanted in self._names:
            raise Broken("an identity that is in use")
        # A name that begins with a zero byte nobody can choose.
        name = wanted or b"\0" + secrets.token_bytes(8)
        self._names[name] = connection
        return name

    def heard(self, connection: Connection) -> None:
        """Note that a connection said something now."""
        connection.heard_s = self.loop.time()
        del self._connections[connection]
        self._connections[connection] = None

    def forget(self, connection: Connection) -> None:
        """Take a closed connection off the lists; its place is free."""
        self._connections.pop(connection, None)
        if self._names.get(connection.identity) is connection:
            del self._names[connection.identity]
        self._listen()

    def close(self) -> None:
        """Close everything, and take the socket out of its folder."""
        self._closed = True
        self._pause()
        if self._retry is not None:
            self._retry.cancel()
        for connection in tuple(self._connections):
            connection.close()
        if self._line.family == socket.AF_UNIX:
            with contextlib.suppress(OSError):
                os.unlink(self._line.getsockname())
        self._line.close()

    def _listen(self) -> None:
        if not self._closed and not self._listening:
            self._listening = True
            self.loop.add_reader(self._line, self._on_knock)

    def _pause(self) -> None:
        if self._listening:
            self._listening = False
            self.loop.remove_reader(self._line)

    def _on_knock(self) -> None:
        # One at a time, so that a crowd does not hold up what else the loop has to do.
        if len(self) >= self.most and not self._made_room():
            self.kept_waiting += 1
            self._pause()
            if self._standing_s < math.inf:
                self._listen_later(self._standing_s)
            return
        try:
            with self._reserve():
                line, _ = self._line.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:
            # No descriptor or no memory. Readable it stays, so look again a little later.
            self.kept_waiting += 1
            self._pause()
            self._listen_later(_RETRY_S)
            return
        line.setblocking(False)
        self._connections[Connection(self, line)] = None

    def _made_room(self) -> bool:
        silent = next(iter(self._connections), None)
        if silent is None or self.loop.time() - silent.heard_s < self._standing_s:
            return False
        self.displaced += 1
        silent.close()
        return True

    def _listen_later(self, delay_s: float) -> None:
        if self._retry is not None:
            self._retry.cancel()
        self._retry = self.loop.call_later(delay_s, self._listen)


def listen_local(address: str, umask: int) -> socket.socket:
    """Return a listening socket at an `ipc://` address. Raises OSError.

    What has the name already is removed: hold the bench's lock. A link there is not followed.
    """
    path = address.removeprefix("ipc://")
    line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)
        previous = os.umask(umask)
        try:
            line.bind(path)
        finally:
            os.umask(previous)
        line.listen(_BACKLOG)
    except OSError:
        line.close()
        raise
    return line


def listen_at(address: str, umask: int) -> socket.socket:
    """Return a listening socket at an address as ZeroMQ writes it (`ipc://…`, `tcp://host:port`).

    Raises OSError, also for an address that is neither.
    """
    if address.startswith("ipc://"):
        return listen_local(address, umask)
    host, colon, port = address.removeprefix("tcp://").rpartition(":")
    if not address.startswith("tcp://") or not colon or not port.isdigit() or int(port) > 65_535:
        raise OSError(0, "it is neither tcp://host:port nor ipc://path")
    host = host.strip("[]")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server(
        ("" if host == "*" else host, int(port)), family=family, backlog=_BACKLOG
    )
