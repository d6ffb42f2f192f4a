"""What both clients share: requests and replies as bytes, and where the daemon is."""

import functools
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import zmq
from msgspec import Struct

from smad.api import BY_PARAMS, LARGEST_MESSAGE, Arm, ErrorData, Motion, Reason, Telemetry
from smad.client.endpoints import (
    Connection,
    candidate_folders,
    read_connection,
    running_benches,
)
from smad.client.errors import NoAnswer, NoDaemon, Refused, refused
from smad.config.curve_key import KEY_CHARACTERS, is_curve_key
from smad.errors import ConfigError

LOOK_S = 0.5
"""How often who waits for a reply looks whether the daemon is there."""

Reply = TypeVar("Reply", bound=Struct)
Socket = zmq.Socket[bytes]


class _Error(Struct, frozen=True):
    code: int
    message: str
    data: ErrorData | None = None


class _Envelope(Struct, frozen=True):
    id: int | str | None = None
    result: msgspec.Raw = msgspec.Raw()
    error: _Error | None = None


_ENCODER = msgspec.json.Encoder()
_ENVELOPE = msgspec.json.Decoder(_Envelope)


class Keys(Struct, frozen=True):
    """CURVE keys for a daemon on another machine, each 40 characters (Z85)."""

    public: str
    secret: str
    server: str


class Conversation:
    """Numbers requests and finds the reply that belongs to one; replies of old ones are dropped.

    `lease` is the secret of our exclusive control (empty: none). `generation` is the one in which
    we armed (None: we did not): what we ask for after that is refused once a stop has come.
    `known` is the last one that this program knows of (None: it began to look at nothing yet): an
    arming of a program that does not know of a stop is refused, until a person starts it anew.
    `motions` has the number of the motion that we commanded last, by axis.
    `lapsed`: our lease has ended without us, so that the daemon has disarmed what we had armed.
    """

    def __init__(self) -> None:
        self.lease = ""
        self.lapsed = False
        self.generation: int | None = None
        self.known: int | None = None
        self.motions: dict[str, int] = {}
        self._last_id = 0

    def begin(self, generation: int | None, *, known: int | None = None) -> None:
        """Set the generation of what is asked for from now on, and of the next arming."""
        self.motions.clear()
        self.generation = generation
        self.known = known

    def stopped(self, generation: int) -> None:
        """Note the generation that our own stop ended in.

        Ours made one. Where more have come, somebody else's stop was among them, and stays unknown.
        """
        if self.known is not None and generation == self.known + 1:
            self.begin(generation, known=generation)

    def commanded(self, motion: Motion, *axes: str) -> None:
        """Note the motion that our command to these axes began."""
        self.motions |= _numbers(motion, axes)

    def is_ours(self, motion: Motion, axis: str) -> bool:
        """Return whether no axis that we command does what somebody else has commanded since."""
        now = _numbers(motion, (axis,))
        return all(self.motions.get(name, number) == number for name, number in now.items())

    def request(
        self, params: Struct, axes: str | tuple[str, ...] | None = None
    ) -> tuple[int, bytes]:
        """Return the id and the bytes of a request; `axes` are those that it is for.

        Raises Refused for a number that is not finite, and when it is too long to send.
        """
        method = BY_PARAMS[type(params)]
        _refuse_infinite(method.name, "", msgspec.to_builtins(params))
        self._last_id += 1
        request: dict[str, Any] = {
            "jsonrpc": "2.0",
            "id": self._last_id,
            "method": method.name,
            "params": params,
        }
        if axes:
            request["axis"] = axes
        if self.lease:
            request["lease"] = self.lease
        generation = self.known if isinstance(params, Arm) else self.generation
        if generation is not None and method.ends_with_stop:
            request["generation"] = generation
        data = _ENCODER.encode(request)
        if len(data) > LARGEST_MESSAGE:
            raise Refused(
                f"{method.name}: the command is too long to send",
                value=f"{len(data)} bytes",
                limit=f"{LARGEST_MESSAGE} bytes",
                action="it was not sent, as the daemon would refuse it; send it in pieces",
            )
        return self._last_id, data

    def reply(self, data: bytes, call_id: int, kind: type[Reply]) -> Reply | None:
        """Return the reply, or None when `data` belongs to another request.

        Raises Refused when the daemon refused, or when the reply is not of a kind we know.
        """
        try:
            envelope = _ENVELOPE.decode(data)
            if envelope.id != call_id:
                return None
            if envelope.error is None:
                return msgspec.json.decode(envelope.result, type=kind)
        except msgspec.MsgspecError as error:
            raise Refused(
                f"the daemon's reply cannot be read: {error}",
                reason=Reason.INTERNAL,
                action="use the same version of smad for client and daemon",
            ) from error
        if envelope.error.data is not None:
            if self.lease and envelope.error.data.reason is Reason.NOT_IN_CONTROL:
                self.lapsed = True
            raise refused(envelope.error.data)
        raise Refused(envelope.error.message)


def _numbers(motion: Motion, axes: Sequence[str]) -> dict[str, int]:
    parts = motion.axes or dict.fromkeys(axes, motion)
    return {name: part.number for name, part in parts.items()}


def _refuse_infinite(where: str, path: str, value: Any) -> None:
    """JSON writes nan and infinity as null, which in an optional field means "no limit"."""
    if isinstance(value, dict):
        for name, item in value.items():
            _refuse_infinite(where, f"{path}.{name}" if path else name, item)
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _refuse_infinite(where, f"{path}[{index}]", item)
    elif isinstance(value, float) and not math.isfinite(value):
        raise Refused(
            f"{where}: {path} is not a finite number",
            value=value,
            limit="finite numbers",
            action="nothing was changed; leave an optional field out instead",
        )


@functools.cache
def _telemetry_decoder() -> msgspec.json.Decoder[Telemetry]:
    return msgspec.json.Decoder(Telemetry)


def telemetry_of(data: bytes) -> Telemetry:
    """Return one published sample. Raises msgspec.ValidationError when it is not one of ours."""
    return _telemetry_decoder().decode(data)


def find_daemon(bench: str, folder: str | Path | None) -> Connection:
    """Return how to reach the running daemon of a bench. Raises NoDaemon."""
    folders = candidate_folders() if folder is None else (Path(folder),)
    for candidate in folders:
        connection = read_connection(candidate / f"{bench}.json")
        if connection is not None:
            return connection
    others = ", ".join(running_benches(folders))
    raise NoDaemon(
        f"no daemon is running for the bench {bench!r} "
        f"(looked in {', '.join(str(f) for f in folders)})",
        action=(f"running: {others}; name it (--bench), or " if others else "")
        + "start one: smad start --port /dev/serial/by-id/…, or smad start --sim",
    )


def remote(address: str, stop_address: str, telemetry: str, keys: Keys) -> Connection:
    """Return the connection to a daemon on another machine. Raises ConfigError for a bad key."""
    for name, key in msgspec.structs.asdict(keys).items():
        if not is_curve_key(key):
            # A secret key is not repeated where others may read it.
            raise ConfigError(
                f"the CURVE key {name!r} is not valid",
                value=f"{len(key)} characters" if name == "secret" else key,
                limit=f"{KEY_CHARACTERS} characters of Z85",
                action="make a pair with `smad keys`; the server's public key is in the bench's "
                "connection file",
            )
    return Connection(
        bench="",
        pid=0,
        version="",
        command=address,
        stop=stop_address,
        telemetry=telemetry,
        server_key=keys.server,
    )


def connect_both(context: zmq.Context[Any], connection: Connection, keys: Keys | None) -> Any:
    """Return the sockets for commands and for stops, as one client. Raises ConfigError."""
    identity = new_identity()
    commands = connect(context, connection.command, keys, identity)
    try:
        return commands, connect(context, connection.stop, keys, identity)
    except ConfigError:
        commands.close(linger=0)
        raise


def connect(context: zmq.Context[Any], address: str, keys: Keys | None, identity: bytes) -> Any:
    """Return a DEALER socket that talks to `address`. Raises ConfigError when that is none."""
    socket = context.socket(zmq.DEALER)
    socket.setsockopt(zmq.LINGER, 0)
    # What waits for a daemon that has ended must not be carried out by the next one.
    socket.setsockopt(zmq.IMMEDIATE, 1)
    socket.setsockopt(zmq.IDENTITY, identity)
    try:
        if keys is not None:
            socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public.encode())
            socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret.encode())
            socket.setsockopt(zmq.CURVE_SERVERKEY, keys.server.encode())
        socket.connect(address)
    except zmq.ZMQError as error:
        # A socket that is left open keeps the interpreter from ending.
        socket.close(linger=0)
        raise ConfigError(
            f"cannot connect: {error.strerror}",
            value=address,
            limit="tcp://host:port, or ipc://path",
            action="correct the address",
        ) from error
    return socket


def subscribe(context: zmq.Context[Any], address: str, topic: bytes, queue: int) -> Any:
    """Return a SUB socket for the telemetry at `address`."""
    socket = context.socket(zmq.SUB)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.RCVHWM, queue)
    socket.setsockopt(zmq.SUBSCRIBE, topic)
    socket.connect(address)
    return socket


def new_identity() -> bytes:
    """Return a name for a client's socket that nobody can guess."""
    # ZeroMQ keeps names that begin with a zero byte for itself.
    return b"c" + os.urandom(16)


def no_answer(connection: Connection, limit_s: float) -> NoAnswer:
    """Return the error of a reply that did not come."""
    return NoAnswer(
        "the daemon did not answer; the command may have been carried out",
        value=connection.command,
        limit=f"{limit_s:g} s",
        action="look at smad status, and at the daemon's own output",
    )


def ended(connection: Connection) -> bool:
    """Return whether the daemon of this machine has ended, and no other serves the bench."""
    if not connection.pid:
        return False
    return read_connection(Path(f"{connection.command.removeprefix('ipc://')[:-8]}.json")) is None


def has_ended(connection: Connection) -> NoAnswer:
    """Return the error of a request to a daemon that has ended."""
    return NoAnswer(
        "the daemon has ended; the command may have been carried out",
        value=connection.command,
        action="start it again (smad start), and look at smad status",
    )


def require_open(socket: zmq.Socket[Any]) -> None:
    """Raise NoDaemon if the client whose socket this is was closed."""
    if socket.closed:
        raise NoDaemon("this client is closed", action="make another: smad.Client()")


def no_telemetry(limit_s: float) -> NoAnswer:
    """Return the error of a sample that did not come."""
    return NoAnswer(
        "no telemetry came",
        limit=f"{limit_s:g} s",
        action="see smad status: is the board connected, is telemetry enabled?",
    )
