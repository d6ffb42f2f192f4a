"""What the board's bytes go through: a pseudo-terminal, or an inherited socket.

A port never blocks and never raises for what the other side does: nobody there, gone, or not
reading are counted, as on a real line.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import termios
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sim_device.errors import PortError

READ_SIZE = 65_536
PENDING_MOST = 8192
"""A reader this far behind loses whole pieces, newest first; the rest of a cut one always goes."""


@dataclass(slots=True)
class PortCounts:
    """Bytes that passed, and what did not."""

    bytes_in: int = 0
    bytes_out: int = 0
    short_writes: int = 0
    dropped: int = 0


class Port(Protocol):
    """One byte stream. `name` is what a client opens."""

    name: str
    counts: PortCounts

    def fileno(self) -> int | None:
        """What to wait on for bytes; None while nobody can send any."""
        ...

    def read(self) -> bytes:
        """Return what came, nothing if nothing did."""
        ...

    def write(self, data: bytes) -> None:
        """Send what fits now; the rest waits or is dropped."""
        ...

    def close(self) -> None:
        """Give it up."""
        ...


class _Outlet:
    """Non-blocking writes to one descriptor: short counts are kept, a full pipe drops."""

    def __init__(self, fd: int, counts: PortCounts) -> None:
        self._fd = fd
        self._counts = counts
        self._pending = bytearray()

    def write(self, data: bytes) -> None:
        """Write what was left and then `data`; raises OSError other than BlockingIOError."""
        if self._pending:
            if len(self._pending) + len(data) > PENDING_MOST:
                self._counts.dropped += 1
            else:
                self._pending += data
            data = bytes(self._pending)
            self._pending.clear()
        if not data:
            return
        try:
            taken = os.write(self._fd, data)
        except BlockingIOError:
            taken = 0
        self._counts.bytes_out += taken
        if taken < len(data):
            self._counts.short_writes += 1
            self._pending += data[taken:]

    def forget(self) -> None:
        """Drop what waits."""
        self._pending.clear()


class PtyPort:
    """The master side of a raw pseudo-terminal, with an optional symlink to its tty.

    `counts` are those to go on with, for a port that comes back under another name.
    Raises PortError when the system gives none or the symlink cannot be made.
    """

    def __init__(self, symlink: Path | None = None, counts: PortCounts | None = None) -> None:
        try:
            self._master, slave = os.openpty()
        except OSError as error:
            raise PortError(
                f"no pseudo-terminal to be had ({error.strerror}); close some terminals"
            ) from error
        tty.setraw(slave)
        self.name = os.ttyname(slave)
        # The slave is not kept open: so a poll of the master tells whether a client is there, and
        # samples nobody reads do not pile up for the next one.
        os.close(slave)
        os.set_blocking(self._master, False)
        self.counts = PortCounts() if counts is None else counts
        self._outlet = _Outlet(self._master, self.counts)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._attended = False
        self._symlink = symlink
        if symlink is not None:
            _point(symlink, self.name)

    def fileno(self) -> int | None:
        return self._master if self._client_connected() else None

    def read(self) -> bytes:
        try:
            data = os.read(self._master, READ_SIZE)
        except OSError:
            # No client: reading the master of a closed tty is an I/O error, not an end.
            return b""
        self.counts.bytes_in += len(data)
        return data

    def write(self, data: bytes) -> None:
        if not self._client_connected():
            return
        with contextlib.suppress(OSError):
            self._outlet.write(data)

    def close(self) -> None:
        if self._symlink is not None:
            _unpoint(self._symlink, self.name)
        os.close(self._master)

    def _client_connected(self) -> bool:
        events = self._poll.poll(0)
        connected = not (events and events[0][1] & select.POLLHUP)
        if self._attended and not connected:
            self._outlet.forget()
            self._flush()
        self._attended = connected
        return connected

    def _flush(self) -> None:
        """Throw away what the client that left did not read."""
        with contextlib.suppress(OSError, termios.error):
            slave = os.open(self.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                termios.tcflush(slave, termios.TCIOFLUSH)
                tty.setraw(slave)
            finally:
                os.close(slave)


class SocketPort:
    """One end of a connected stream socket, such as a socket pair whose other end a test holds."""

    def __init__(
        self, end: socket.socket, name: str = "socket", counts: PortCounts | None = None
    ) -> None:
        end.setblocking(False)
        self._end = end
        self.name = name
        self.counts = PortCounts() if counts is None else counts
        self._outlet = _Outlet(end.fileno(), self.counts)
        self._open = True

    def fileno(self) -> int | None:
        return self._end.fileno() if self._open else None

    def read(self) -> bytes:
        try:
            data = os.read(self._end.fileno(), READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._open = False
        self.counts.bytes_in += len(data)
        return data

    def write(self, data: bytes) -> None:
        if not self._open:
            return
        try:
            self._outlet.write(data)
        except OSError:
            self._open = False

    def close(self) -> None:
        self._end.close()
        self._open = False


def socket_from_descriptor(number: int, counts: PortCounts | None = None) -> SocketPort:
    """Return the port on an inherited descriptor. Raises PortError if it is no socket."""
    try:
        return SocketPort(socket.socket(fileno=number), f"fd:{number}", counts)
    except OSError as error:
        raise PortError(
            f"descriptor {number} is not an open socket ({error.strerror}); "
            "pass one end of a socket pair to this process"
        ) from error


def _point(symlink: Path, target: str) -> None:
    """Make `symlink` point to `target` in one step; a file that is no symlink stays."""
    if symlink.exists() and not symlink.is_symlink():
        raise PortError(f"{symlink} exists and is not a symlink; choose another name or remove it")
    beside = symlink.with_name(f".{symlink.name}.{os.getpid()}")
    try:
        beside.unlink(missing_ok=True)
        beside.symlink_to(target)
        beside.replace(symlink)
    except OSError as error:
        raise PortError(
            f"cannot make the symlink {symlink} ({error.strerror}); choose a folder that exists "
            "and that you may write to"
        ) from error


def _unpoint(symlink: Path, target: str) -> None:
    """Remove `symlink` if it still points to `target`."""
    with contextlib.suppress(OSError):
        if os.readlink(symlink) == target:
            symlink.unlink()
