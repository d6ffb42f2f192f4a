"""How many files and sockets the daemon may have open, and who gets how many of them.

ZeroMQ 4.3.5 ends the process when it finds no descriptor for a local connection. So local
connections are accepted by ourselves, up to a share each; ZeroMQ has TCP only, where it goes on.
"""

import contextlib
import errno
import os
import resource
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from smad.errors import DaemonError

Reserve = Callable[[], AbstractContextManager[Any]]
"""A block in which descriptors of the reserve may be used."""

RESERVE = 16
"""Descriptors that no connection over TCP can take: for local stops, the port, the run log."""

OPENED_LATER = 8
"""The port and its lock, the run log, what real-time measures need, a file that is looked at."""

LEAST_A_SHARE = 4
_USEFUL = 16_384
"""More are never needed; a limit far above would only make a leak slow to show."""

_MOST_A_SHARE = 256
_MOST_TCP = 1024


@dataclass(frozen=True)
class Shares:
    """Connections at once, at most."""

    stop: int = _MOST_A_SHARE
    command: int = _MOST_A_SHARE
    telemetry: int = _MOST_A_SHARE
    tcp: int = _MOST_TCP


def open_descriptors() -> int:
    """Return how many descriptors this process has open."""
    try:
        # One is that of the folder while it is read.
        return len(os.listdir("/proc/self/fd")) - 1
    except OSError as error:
        # Not even one for the folder: all that are allowed are open. The reserve is not opened
        # for this, since ZeroMQ's thread would take from it meanwhile.
        if error.errno != errno.EMFILE:
            raise
        return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def shares_of(limit: int, used: int, *, tcp: bool) -> Shares:
    """Divide what a limit leaves beside `used` and the reserve.

    Raises DaemonError when that is too little to run with.
    """
    parts = 4 if tcp else 3
    free = limit - RESERVE - used
    share = free // parts
    if share < LEAST_A_SHARE:
        raise DaemonError(
            "the limit on open files is too low to run a bench safely",
            value=limit,
            limit=f"at least {used + RESERVE + parts * LEAST_A_SHARE}",
            action="raise it (ulimit -n 1024, or LimitNOFILE in the service file)",
        )
    local = min(share, _MOST_A_SHARE)
    return Shares(local, local, local, min(free - 3 * local, _MOST_TCP) if tcp else 0)


class Descriptors:
    """The process's limit: raised as far as allowed, less a reserve that `reserve()` opens."""

    def __init__(self) -> None:
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        self.limit = _USEFUL if hard == resource.RLIM_INFINITY else min(hard, _USEFUL)
        self._hard = hard
        self._lock = threading.Lock()
        self._users = 0

    def set_reserve_aside(self) -> None:
        """Raise the limit, and keep the reserve from everything but `reserve()`."""
        self._set(self.limit - RESERVE)

    @contextlib.contextmanager
    def reserve(self) -> Iterator[None]:
        """While the block lasts, what is opened may come out of the reserve."""
        with self._lock:
            self._users += 1
            self._set(self.limit)
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                if not self._users:
                    self._set(self.limit - RESERVE)

    def _set(self, soft: int) -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, self._hard))
