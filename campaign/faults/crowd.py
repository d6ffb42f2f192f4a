"""More connections at once than a daemon has descriptors for, all of them silent."""

from __future__ import annotations

import contextlib
import errno
import resource
import socket
from collections.abc import Iterator

import zmq

from smad.client.endpoints import Connection
from smad.errors import SmadError

_SPARE = 100
_PENDING = (0, errno.EINPROGRESS)


@contextlib.contextmanager
def crowd(connection: Connection, count: int) -> Iterator[None]:
    """Hold `count` connections over TCP, and `count` ZeroMQ clients on this machine.

    They come as fast as they can, to stops and commands in turn; the strangers never greet.
    Raises SmadError when this process may not have as many.
    """
    _require_descriptors(3 * count + _SPARE)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    context.set(zmq.MAX_SOCKETS, count + _SPARE)
    strangers: list[socket.socket] = []
    addresses = (connection.tcp_stop, connection.tcp_command)
    here = (connection.stop, connection.command, connection.telemetry)
    try:
        for number in range(count):
            strangers.append(_stranger(addresses[number % 2]))
            place = here[number % 3]
            client = context.socket(zmq.SUB if place == connection.telemetry else zmq.DEALER)
            client.connect(place)
        yield
    finally:
        for line in strangers:
            line.close()
        context.destroy(linger=0)


def _stranger(address: str) -> socket.socket:
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    line = socket.socket()
    line.setblocking(False)
    if line.connect_ex((host, int(port))) not in _PENDING:
        line.close()
        raise SmadError("the daemon does not listen over TCP", value=address)
    return line


def _require_descriptors(needed: int) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise SmadError(
            "this process may not open as many files as the trial needs",
            value=hard,
            limit=f"at least {needed}",
            action="raise the limit (ulimit -n)",
        )
    if soft != resource.RLIM_INFINITY and soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
