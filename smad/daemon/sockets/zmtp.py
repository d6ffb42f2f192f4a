"""One end of ZeroMQ's wire protocol (ZMTP 3.0, mechanism NULL) without sockets: bytes in and out.

Rules: the peer's greeting and READY come first, in that order; everything longer or older than we
know is refused. `Peer.receive` never waits, `Peer.take` gives one thing at a time.

Reference: https://rfc.zeromq.org/spec/23/ (ZMTP 3.0) and /37/ (the commands of 3.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass

_MORE, _LONG, _COMMAND = 1, 2, 4
_SIGNATURE_BYTES = 10
_GREETING_BYTES = 64
_NULL = b"NULL".ljust(20, b"\0")
_MOST_COMMAND_BYTES = 1024
_MOST_FRAMES = 16
_MOST_IDENTITY_BYTES = 255

GREETING = b"\xff\0\0\0\0\0\0\0\x01\x7f" + b"\x03\x00" + _NULL + bytes(32)
"""What both ends say first: signature, version 3.0, mechanism, and no claim to be a server."""


class Broken(Exception):
    """The peer does not speak this protocol, or not to us; its connection must be closed."""


class TooLong(Broken):
    """The peer sends a message longer than is taken."""


@dataclass(frozen=True, slots=True)
class Greeted:
    """The peer has introduced itself, with the identity it chose (empty: none)."""

    identity: bytes


@dataclass(frozen=True, slots=True)
class Message:
    """A whole message of one frame or more."""

    frames: list[bytes]


@dataclass(frozen=True, slots=True)
class Subscription:
    """A subscriber wants messages with this prefix (`on`), or does not want them any more."""

    topic: bytes
    on: bool


@dataclass(frozen=True, slots=True)
class Reply:
    """Bytes that the protocol itself owes the peer."""

    data: bytes


Taken = Greeted | Message | Subscription | Reply


def encoded(frames: Sequence[bytes]) -> bytes:
    """Return a message of these frames as bytes on the wire."""
    last = len(frames) - 1
    return b"".join(_frame(body, 0 if n == last else _MORE) for n, body in enumerate(frames))


def ready(socket_type: bytes, identity: bytes = b"") -> bytes:
    """Return the command that opens a connection, as an end of that type."""
    properties = _property(b"Socket-Type", socket_type) + _property(b"Identity", identity)
    return _frame(b"\x05READY" + properties, _COMMAND)


class Peer:
    """What is known of the other end, and what it sent that has not been taken yet.

    `accepts` are the socket types that may talk to us, `longest` the bytes of a message.
    `publishes`: messages of the peer are subscriptions.
    """

    def __init__(self, accepts: frozenset[bytes], longest: int, *, publishes: bool = False) -> None:
        self._accepts = accepts
        self._longest = longest
        self._publishes = publishes
        self._data = bytearray()
        self._frames: list[bytes] = []
        self._hailed = False
        self._greeted = False

    @property
    def waiting(self) -> int:
        """Bytes that were received and not taken."""
        return len(self._data)

    def receive(self, data: bytes) -> None:
        """Keep what came."""
        self._data += data

    def take(self) -> Taken | None:
        """Return the next thing the peer said, or None until more comes. Raises Broken."""
        if not self._hailed:
            if not self._take_greeting():
                return None
            self._hailed = True
        while (frame := self._take_frame()) is not None:
            flags, body = frame
            taken = self._command(body) if flags & _COMMAND else self._message(flags, body)
            if taken is not None:
                return taken
        return None

    def _take_greeting(self) -> bool:
        data = self._data
        if (data and data[0] != 0xFF) or (len(data) >= _SIGNATURE_BYTES and not data[9] & 1):
            raise Broken("no ZMTP greeting")
        if len(data) > _SIGNATURE_BYTES and data[10] < 3:
            raise Broken("a version of ZMTP before 3")
        if len(data) < _GREETING_BYTES:
            return False
        if bytes(data[12:32]) != _NULL:
            raise Broken("another mechanism than NULL")
        del data[:_GREETING_BYTES]
        return True

    def _take_frame(self) -> tuple[int, bytes] | None:
        data = self._data
        if not data:
            return None
        flags = data[0]
        if flags & ~(_MORE | _LONG | _COMMAND) or (flags & _COMMAND and flags & _MORE):
            raise Broken("a frame of an unknown kind")
        head = 9 if flags & _LONG else 2
        if len(data) < head:
            return None
        size = int.from_bytes(data[1:head], "big")
        if flags & _COMMAND or not self._greeted:
            if size > _MOST_COMMAND_BYTES:
                raise Broken("a command that is too long")
        elif size + sum(map(len, self._frames)) > self._longest:
            raise TooLong(f"a message of {size} bytes")
        if len(data) < head + size:
            return None
        body = bytes(data[head : head + size])
        del data[: head + size]
        return flags, body

    def _message(self, flags: int, body: bytes) -> Taken | None:
        if not self._greeted:
            raise Broken("a message before READY")
        self._frames.append(body)
        if flags & _MORE:
            if len(self._frames) >= _MOST_FRAMES:
                raise TooLong(f"a message of more than {_MOST_FRAMES} frames")
            return None
        frames, self._frames = self._frames, []
        if not self._publishes:
            return Message(frames)
        if body[:1] in (b"\0", b"\1"):
            return Subscription(body[1:], body[:1] == b"\1")
        return None

    def _command(self, body: bytes) -> Taken | None:
        name, rest = _named(body)
        if not self._greeted:
            if name != b"READY":
                raise Broken("a command before READY")
            return self._ready(rest)
        if name == b"PING":
            return Reply(_frame(b"\x04PONG" + rest[2:18], _COMMAND))
        if self._publishes and name in (b"SUBSCRIBE", b"CANCEL"):
            return Subscription(rest, name == b"SUBSCRIBE")
        if name == b"ERROR":
            raise Broken("the peer gave up")
        return None

    def _ready(self, rest: bytes) -> Greeted:
        properties = _properties(rest)
        if properties.get(b"socket-type") not in self._accepts:
            raise Broken("a socket of a type that does not belong here")
        identity = properties.get(b"identity", b"")
        if len(identity) > _MOST_IDENTITY_BYTES or identity[:1] == b"\0":
            raise Broken("an identity that is not allowed")
        self._greeted = True
        return Greeted(identity)


def _frame(body: bytes, flags: int) -> bytes:
    if len(body) > 255:
        return bytes((flags | _LONG,)) + len(body).to_bytes(8, "big") + body
    return bytes((flags, len(body))) + body


def _property(name: bytes, value: bytes) -> bytes:
    return bytes((len(name),)) + name + len(value).to_bytes(4, "big") + value


def _named(body: bytes) -> tuple[bytes, bytes]:
    end = 1 + body[0] if body else 0
    if end < 2 or end > len(body):
        raise Broken("a command without a name")
    return body[1:end], body[end:]


def _properties(data: bytes) -> dict[bytes, bytes]:
    properties: dict[bytes, bytes] = {}
    while data:
        name, rest = _named(data)
        size = int.from_bytes(rest[:4], "big")
        if len(rest) < 4 + size:
            raise Broken("a property that is cut short")
        properties[name.lower()] = rest[4 : 4 + size]
        data = rest[4 + size :]
    return properties
