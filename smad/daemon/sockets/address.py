"""Sockets that listen at an address as ZeroMQ writes it."""

import contextlib
import os
import socket

BACKLOG = 128


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
        line.listen(BACKLOG)
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
        ("" if host == "*" else host, int(port)), family=family, backlog=BACKLOG
    )
