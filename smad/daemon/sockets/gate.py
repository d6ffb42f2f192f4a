"""A TCP port that can be closed to newcomers while those who are in stay.

ZeroMQ has no limit on connections, and ends all of a port's when it stops listening there. So the
listening socket is made here, and the kernel is told to drop what arrives at it (a socket filter
that lets nothing through); connections that stand have sockets of their own.
"""

import contextlib
import ctypes
import os
import re
import select
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

from smad.daemon.sockets.address import BACKLOG
from smad.daemon.sockets.descriptors import Reserve

_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27
_RETURN = 0x06
_TAKEN_ON_WITHIN_S = 30.0


class Gate:
    """A listening TCP socket. Raises OSError when the address cannot be had."""

    def __init__(self, host: str, port: int) -> None:
        family, kind, number, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        self._socket = socket.socket(family, kind, number)
        self._nobody = socket.socket(family, kind, number)
        self._zeromq = -1
        self.is_open = True
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(address)
            self._socket.listen(BACKLOG)
            self._socket.setblocking(False)
            _let_nobody_in(self._nobody)
            self._nobody.listen(1)
            self._nobody.setblocking(False)
        except OSError:
            self.close()
            raise

    def for_zeromq(self) -> int:
        """Return a descriptor of it that ZeroMQ may keep (and closes)."""
        self._zeromq = os.dup(self._socket.fileno())
        return self._zeromq

    def wait_until_taken_on(self) -> None:
        """Wait until ZeroMQ's thread listens at the descriptor, which is after `bind` returns.

        Were the gate held before, the thread would put the other socket on its list, and end the
        process when it does not find that one there at the end. Raises TimeoutError.
        """
        deadline = time.monotonic() + _TAKEN_ON_WITHIN_S
        while not _is_polled(self._zeromq):
            if time.monotonic() > deadline:
                raise TimeoutError(0, "ZeroMQ's thread does not listen there")
            time.sleep(0.001)

    @contextlib.contextmanager
    def hidden_from_zeromq(self) -> Iterator[None]:
        """While the block lasts, ZeroMQ's thread finds nobody who waits at the port.

        Otherwise it takes every descriptor that comes free, however briefly, for a crowd.
        """
        os.dup2(self._nobody.fileno(), self._zeromq, inheritable=False)
        try:
            yield
        finally:
            os.dup2(self._socket.fileno(), self._zeromq, inheritable=False)

    def shut(self, reserve: Reserve) -> None:
        """Let nobody in; a client that tries hears nothing, and tries again.

        Those who had arrived and were not taken in are turned away, on descriptors of the reserve:
        without a descriptor to take them in, ZeroMQ's thread would do nothing but try.
        """
        if self.is_open:
            _let_nobody_in(self._socket)
            self.is_open = False
        with contextlib.suppress(OSError), reserve():
            while True:
                self._socket.accept()[0].close()

    def open(self) -> None:
        """Let newcomers in again."""
        if not self.is_open:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)
            self.is_open = True

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
        self._nobody.close()


def _is_polled(descriptor: int) -> bool:
    """Say whether an epoll of this process waits for input at a descriptor (proc_pid_fdinfo(5))."""
    watched = re.compile(rf"^tfd: +{descriptor} events: +([0-9a-f]+)", re.MULTILINE)
    for info in Path("/proc/self/fdinfo").iterdir():
        with contextlib.suppress(OSError):
            for events in watched.findall(info.read_text()):
                if int(events, 16) & select.EPOLLIN:
                    return True
    return False


def _let_nobody_in(line: socket.socket) -> None:
    # One instruction: keep 0 bytes of whatever arrives.
    program = ctypes.create_string_buffer(struct.pack("=HBBI", _RETURN, 0, 0, 0))
    line.setsockopt(
        socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("@HP", 1, ctypes.addressof(program))
    )
