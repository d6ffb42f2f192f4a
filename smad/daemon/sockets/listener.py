"""Connections that speak ZeroMQ without encryption, held by the daemon's own loop.

ZeroMQ's own listener ends the process when descriptors run out. This one takes in so many
connections and no more; who comes later waits in the kernel's queue until a place is free.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import fcntl
import math
import os
import secrets
import select
import socket
import sys
import termios
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass

from smad.daemon.sockets.address import BACKLOG, listen_local
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.sockets.zmtp import (
    GREETING,
    Broken,
    Greeted,
    Message,
    Peer,
    Reply,
    Subscription,
    ready,
)

HANDSHAKE_S = 2.0
_PIECE = 65_536
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
        self.behind = False
        """Whether its next message may have been sent before the last call of `mark`."""
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

    def mark(self) -> None:
        """Note that what has not been read by now was sent before something that happens now.

        A peer that is still greeting may have a message ready that it could not send yet.
        """
        self.behind = self.behind or not self.greeted or self._unread()

    def _unread(self) -> bool:
        return self.message is not None or self._peer.waiting > 0 or bytes_unread(self._line) > 0

    def advance(self) -> None:
        """Look for the next message; it is then in `message`, or None."""
        served = self.message is not None
        self.message = None
        try:
            while self.message is None and (taken := self._peer.take()) is not None:
                self._take(taken)
        except Broken as broken:
            self._listener.on_broken(self, broken)
            self.close()
        else:
            if self.behind and served and not self._unread():
                self.behind = False
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


@dataclass(frozen=True)
class Terms:
    """As which kind of ZeroMQ socket a listener speaks, with which kinds, and how much at once.

    `longest`: bytes of a message. `queue`: messages that a peer has not read. `standing_s`: how
    long a silent peer keeps its place while others wait.
    """

    kind: bytes
    accepts: frozenset[bytes]
    longest: int
    queue: int
    standing_s: float = math.inf


@dataclass(frozen=True)
class Hooks:
    """Whom a listener tells. `on_message`: a connection has a message and had none before."""

    on_message: Callable[[Connection], None] = lambda connection: None
    on_broken: Callable[[Connection, Broken], None] = lambda connection, broken: None
    before_reading: Callable[[], None] = lambda: None


class Listener:
    """Takes connections at one address, at most `most` at once.

    When all places are taken, the peer that has been silent for longest gives its place to one
    that waits. (ZeroMQ's clients connect again by themselves when they have to say something.)
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        line: socket.socket,
        terms: Terms,
        hooks: Hooks,
        *,
        most: int = 256,
        reserve: Reserve = nullcontext,
    ) -> None:
        self.loop = loop
        self.kind = terms.kind
        self.queue = terms.queue
        self.on_message = hooks.on_message
        self.on_broken = hooks.on_broken
        self.before_reading = hooks.before_reading
        self.most = most
        self.kept_waiting = 0
        """How often somebody had to wait because all places were taken, or no descriptor was."""
        self.displaced = 0
        self._accepts = terms.accepts
        self._longest = terms.longest
        self._standing_s = terms.standing_s
        self._reserve = reserve
        self._line = line
        # In the order in which they were last heard.
        self._connections: dict[Connection, None] = {}
        self._names: dict[bytes, Connection] = {}
        self._listening = False
        self._knocked_before = False
        self._retry: asyncio.TimerHandle | None = None
        self._closed = False
        line.setblocking(False)
        self._listen()

    @property
    def path(self) -> str:
        """The name of its socket in the file system; empty for TCP."""
        return str(self._line.getsockname()) if self._line.family == socket.AF_UNIX else ""

    def listen_again(self, umask: int) -> None:
        """Make the socket anew in its folder; connections go on, and who knocked comes in.

        Raises OSError; it listens at the old one then.
        """
        line = listen_local(self.path, umask)
        line.setblocking(False)
        for _ in range(BACKLOG):
            if not self._somebody_knocks() or not self._listening:
                break
            self._on_knock()
        self._pause()
        self._line.close()
        self._line = line
        self._listen()

    def mark(self) -> None:
        """Note that what was sent, or knocked, until now came before something that happens now."""
        for connection in self._connections:
            connection.mark()
        self._knocked_before = not self._closed and self._somebody_knocks()

    def _somebody_knocks(self) -> bool:
        look = select.poll()
        look.register(self._line, select.POLLIN)
        return bool(look.poll(0))

    def __iter__(self) -> Iterator[Connection]:
        return iter(self._connections)

    def __len__(self) -> int:
        return len(self._connections)

    def peer(self) -> Peer:
        """Return the protocol's side of a new connection."""
        return Peer(self._accepts, self._longest, publishes=self.kind == b"PUB")

    def name(self, connection: Connection, wanted: bytes) -> bytes:
        """Return the name a connection goes by: what it asks for, unless another one has that.

        Whoever asks for a name in use is heard all the same: it may be there to stop the bench.
        """
        name = wanted
        if not wanted or wanted in self._names:
            # A name that begins with a zero byte nobody can choose.
            name = b"\0" + secrets.token_bytes(8)
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
        if self.path:
            with contextlib.suppress(OSError):
                os.unlink(self.path)
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
            line = self._accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError:
            # No descriptor or no memory. Readable it stays, so look again a little later.
            self.kept_waiting += 1
            self._pause()
            self._listen_later(min(_RETRY_S, self._standing_s))
            return
        line.setblocking(False)
        connection = Connection(self, line)
        self._connections[connection] = None
        if self._knocked_before:
            connection.mark()
            self._knocked_before = self._somebody_knocks()

    def _accept(self) -> socket.socket:
        try:
            return self._line.accept()[0]
        except OSError as error:
            if error.errno not in (errno.EMFILE, errno.ENFILE):
                raise
        # Its own silent ones go first, so that a crowd on one channel does not eat the reserve.
        self._made_room()
        with self._reserve():
            return self._line.accept()[0]

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


def bytes_unread(line: socket.socket) -> int:
    """Return how many bytes the kernel holds for us to read."""
    count = bytearray(4)
    fcntl.ioctl(line, termios.FIONREAD, count)
    return int.from_bytes(count, sys.byteorder)
