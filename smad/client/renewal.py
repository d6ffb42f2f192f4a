"""A lease renewed beside the program, from a socket of its own: ZeroMQ's are no thread's but one's.

It is renewed while the thread that armed lives, also during a long computation. A process that is
killed, or stopped by SIGSTOP, renews nothing, and the daemon disarms.
"""

import contextlib
import os
import sys
import threading
from pathlib import Path
from typing import Any

import zmq

from smad.api import GetMotion
from smad.client.endpoints import Connection
from smad.client.wire import Conversation, Keys, connect, new_identity

DEFAULT_LEASE_S = 2.0
"""How long a program that armed may be silent before the daemon disarms."""
_EACH = 5
"""Renewals in the time of one lease: a busy computer may delay some of them."""


def program_name() -> str:
    """Who we are, for the messages others get: the program and its process."""
    program = Path(sys.argv[0] if sys.argv else "").name or "python"
    return f"{program[:40]}, process {os.getpid()}"


class Renewal:
    """Renews one lease at a time, from `begin` to `end`."""

    def __init__(self, connection: Connection, keys: Keys | None) -> None:
        self._connection = connection
        self._keys = keys
        self._over: threading.Event | None = None

    def begin(self, lease: str, lease_s: float) -> None:
        """Renew the lease with this secret from now on, while the calling thread lives."""
        self.end()
        self._over = threading.Event()
        threading.Thread(
            target=_renew,
            args=(self._connection, self._keys, lease, lease_s / _EACH),
            kwargs={"over": self._over, "owner": threading.current_thread()},
            name="smad lease",
            daemon=True,
        ).start()

    def end(self) -> None:
        """Renew no more; does nothing when nothing was."""
        if self._over is not None:
            self._over.set()
            self._over = None


def _renew(
    connection: Connection,
    keys: Keys | None,
    lease: str,
    every_s: float,
    *,
    over: threading.Event,
    owner: threading.Thread,
) -> None:
    """Renew a lease until it is over, or the thread that armed has ended."""
    context: zmq.Context[Any] = zmq.Context()
    socket = connect(context, connection.command, keys, new_identity())
    try:
        conversation = Conversation()
        conversation.lease = lease
        while not over.wait(every_s) and owner.is_alive():
            with contextlib.suppress(zmq.Again):
                socket.send(conversation.request(GetMotion())[1], zmq.NOBLOCK)
            with contextlib.suppress(zmq.Again):
                while True:
                    socket.recv(zmq.NOBLOCK)
    finally:
        socket.close(linger=0)
        context.term()
