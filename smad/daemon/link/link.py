"""The link: the port's descriptor on the loop, reopened by itself when it goes away.

It moves bytes and counts; what they mean is the session's business.
"""

import asyncio
import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass

from smad.daemon.link.port import Transport
from smad.errors import PortError

READ_SIZE = 65_536
_LONGEST_BACK_OFF = 8


@dataclass
class LinkCounts:
    """What went through the port, and what it would not take."""

    bytes_in: int = 0
    bytes_out: int = 0
    short_writes: int = 0
    losses: int = 0
    opens: int = 0


class Link:
    """Owns the transport. `on_bytes`, `on_open`, `on_lost` are called from the loop.

    `opener` opens the port or raises PortError; it is tried again after `retry_s`, doubling up to
    eight times that.
    """

    def __init__(
        self,
        opener: Callable[[], Transport],
        *,
        loop: asyncio.AbstractEventLoop,
        retry_s: float,
        on_bytes: Callable[[bytes], None],
        on_open: Callable[[], None],
        on_lost: Callable[[str], None],
    ) -> None:
        self.counts = LinkCounts()
        self.transport: Transport | None = None
        self._opener = opener
        self._loop = loop
        self._retry_s = retry_s
        self._on_bytes = on_bytes
        self._on_open = on_open
        self._on_lost = on_lost
        self._fd = -1
        self._cut = False
        self._attempts = 0
        self._retry: asyncio.TimerHandle | None = None
        self._closed = False

    def open(self) -> None:
        """Open the port now. Raises PortError; does not try again by itself."""
        transport = self._opener()
        self.transport = transport
        self._fd = transport.fileno()
        self._cut = False
        self._attempts = 0
        self.counts.opens += 1
        self._loop.add_reader(self._fd, self.read)
        self._on_open()

    def read(self) -> None:
        """Take what is there. Called by the loop, and before each command so that none goes first.

        An unplugged port reads as no bytes, for ever, or as an error: both are a loss.
        """
        if self._fd < 0:
            return
        try:
            data = os.read(self._fd, READ_SIZE)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(error.strerror or "read failed")
            return
        if not data:
            self._lose("unplugged")
            return
        self.counts.bytes_in += len(data)
        self._on_bytes(data)

    def write(self, data: bytes) -> bool:
        """Write without waiting; False when the port did not take all of it.

        The rest of a short write is dropped: by the time there is room, it is old. The next write
        begins with a delimiter, so that the cut frame spoils no other.
        """
        if self._fd < 0:
            return False
        if self._cut:
            data = b"\0" + data
        try:
            taken = os.write(self._fd, data)
        except BlockingIOError:
            taken = 0
        except OSError as error:
            self._lose(error.strerror or "write failed")
            return False
        self.counts.bytes_out += taken
        if taken == len(data):
            self._cut = False
            return True
        self.counts.short_writes += 1
        self._cut = self._cut or taken > 0
        return False

    def close(self) -> None:
        """Close the port for good."""
        self._closed = True
        if self._retry is not None:
            self._retry.cancel()
        self._release()

    def _lose(self, reason: str) -> None:
        self._release()
        self.counts.losses += 1
        self._on_lost(reason)
        self.open_later()

    def _release(self) -> None:
        if self._fd >= 0:
            with contextlib.suppress(OSError, ValueError):
                self._loop.remove_reader(self._fd)
            self._fd = -1
        if self.transport is not None:
            self.transport.close()
            self.transport = None

    def open_later(self) -> None:
        """Open the port as soon as it can be: it is tried again until then."""
        if self._closed:
            return
        delay_s = self._retry_s * min(2**self._attempts, _LONGEST_BACK_OFF)
        self._attempts += 1
        self._retry = self._loop.call_later(delay_s, self._reopen)

    def _reopen(self) -> None:
        try:
            self.open()
        except PortError:
            self.open_later()
