"""Opening the serial port: one owner, no waiting, and what the driver granted.

A transport has a `fileno()` that the loop can watch: a serial device, or one end of a socket pair
for timing tests without a pseudo-terminal.
"""

import contextlib
import errno
import fcntl
import os
import socket
import struct
import termios
from collections.abc import Callable
from pathlib import Path

import serial

from smad.daemon.lockfile import LockFile, port_lock
from smad.errors import PortError

_BY_ID = Path("/dev/serial/by-id")
_ASYNC_LOW_LATENCY = 0x2000
_SERIAL_STRUCT_WORDS = 32
_FLAGS_WORD = 4
_SLOW_LATENCY_MS = 1


class SerialTransport:
    """A serial device of our own. `notes` says what the driver refused."""

    def __init__(self, device: serial.Serial, lock: LockFile, notes: tuple[str, ...]) -> None:
        self.name = str(device.port)
        self.baud = int(device.baudrate)
        self.notes = notes
        self._device = device
        self._lock = lock

    def fileno(self) -> int:
        return int(self._device.fileno())

    def close(self) -> None:
        # The device may be gone; closing it then fails, and there is nothing left to do about it.
        with contextlib.suppress(OSError, termios.error):
            self._device.close()
        self._lock.release()


class SocketTransport:
    """One end of a connected stream socket."""

    baud = 0
    notes: tuple[str, ...] = ()

    def __init__(self, end: socket.socket, name: str = "socket pair") -> None:
        end.setblocking(False)
        self.name = name
        self._end = end

    def fileno(self) -> int:
        return self._end.fileno()

    def close(self) -> None:
        self._end.close()


Transport = SerialTransport | SocketTransport
"""Bytes in and out of a file descriptor that never blocks; the speed in Bd is 0 without a line."""

Opener = Callable[[], Transport]
"""Opens a port, or raises PortError."""


class PortFinder:
    """Knows a port by its path and, once it was there, by its by-id names.

    A USB adapter that is pulled and plugged in again may come back under another number; its
    by-id name stays.
    """

    def __init__(self, path: str, by_id: Path = _BY_ID) -> None:
        self.path = path
        self._by_id = by_id
        self._aliases: tuple[str, ...] = ()

    def find(self) -> str:
        """Return a path that exists, the configured one first; the configured one if none does."""
        for candidate in (self.path, *self._aliases):
            if os.path.exists(candidate):
                return candidate
        return self.path

    def remember(self, path: str) -> None:
        """Note the by-id names of the device now at `path`."""
        with contextlib.suppress(OSError):
            real = os.path.realpath(path)
            self._aliases = tuple(
                str(link) for link in self._by_id.iterdir() if os.path.realpath(link) == real
            )


def open_serial(path: str, baud: int) -> SerialTransport:
    """Open a serial device exclusively and without waiting.

    Raises PortError when it is missing, not a serial device, in use, or not allowed.
    """
    lock = port_lock(_device_number(path))
    try:
        lock.acquire()
    except BlockingIOError:
        raise _busy(path, lock.holder()) from None
    try:
        device = serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
    except (OSError, ValueError, termios.error) as error:
        lock.release()
        raise _refused(path, baud, error) from error
    fd = device.fileno()
    os.set_blocking(fd, False)
    _set_line(fd)
    return SerialTransport(device, lock, _low_latency(device, path))


def _device_number(path: str) -> int:
    try:
        status = os.stat(path)
    except OSError as error:
        raise _refused(path, 0, error) from error
    if status.st_rdev == 0:
        raise _no_serial_port(path)
    return status.st_rdev


def _no_serial_port(path: str) -> PortError:
    return PortError(
        "this is not a serial port",
        value=path,
        action="name a device, best from /dev/serial/by-id, or use --sim",
    )


def _busy(path: str, holder: str) -> PortError:
    return PortError(
        f"the port is in use by {holder}",
        value=path,
        limit="one owner",
        action="stop the other program (`smad status` shows a running daemon)",
    )


def _refused(path: str, baud: int, error: Exception) -> PortError:
    number = _number(error)
    if number in (errno.EBUSY, errno.EWOULDBLOCK):
        return _busy(path, "another program")
    if number in (errno.EACCES, errno.EPERM):
        return PortError(
            "no permission to open the port",
            value=path,
            action="add yourself to its group (ls -l names it), mostly dialout, and log in again",
        )
    if number == errno.ENOTTY:
        return _no_serial_port(path)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return PortError(
            "there is no such port",
            value=path,
            action="plug the board in and look in /dev/serial/by-id, or use --sim",
        )
    if isinstance(error, ValueError):
        return PortError(
            "the port does not take this baud rate", value=baud, action="set link.baud"
        )
    return PortError(
        f"cannot open the port: {_reason(error)}",
        value=path,
        action="name a serial device, best from /dev/serial/by-id",
    )


def _reason(error: Exception) -> str:
    number = _number(error)
    return str(error) if number is None else os.strerror(number)


def _number(error: BaseException) -> int | None:
    number = getattr(error, "errno", None) or (error.args[0] if error.args else None)
    if isinstance(number, int):
        return number
    # pyserial puts the number of what the driver said into its text.
    return None if error.__context__ is None else _number(error.__context__)


def _set_line(fd: int) -> None:
    with contextlib.suppress(termios.error):
        attributes = termios.tcgetattr(fd)
        # Hanging up on close drops DTR, and many boards reset when it rises at the next open.
        attributes[2] &= ~termios.HUPCL
        # pyserial asks for at least 0 bytes; then "nothing there yet" reads like "unplugged".
        attributes[6][termios.VMIN] = 1
        termios.tcsetattr(fd, termios.TCSANOW, attributes)


def _low_latency(device: serial.Serial, path: str) -> tuple[str, ...]:
    with contextlib.suppress(ValueError, OSError):
        device.set_low_latency_mode(True)
    notes = []
    if not _is_low_latency(device.fileno()):
        notes.append("low-latency mode not granted by the driver (a pseudo-terminal has none)")
    timer_ms = _latency_timer_ms(path)
    if timer_ms is not None and timer_ms > _SLOW_LATENCY_MS:
        notes.append(
            f"the USB adapter holds bytes back for {timer_ms} ms; the udev rule sets it to 1 ms"
        )
    return tuple(notes)


def _is_low_latency(fd: int) -> bool:
    buffer = bytearray(4 * _SERIAL_STRUCT_WORDS)
    try:
        fcntl.ioctl(fd, termios.TIOCGSERIAL, buffer)
    except (OSError, AttributeError):
        return False
    flags = struct.unpack_from("i", buffer, 4 * _FLAGS_WORD)[0]
    return bool(flags & _ASYNC_LOW_LATENCY)


def _latency_timer_ms(path: str) -> int | None:
    name = os.path.basename(os.path.realpath(path))
    try:
        return int(Path(f"/sys/class/tty/{name}/device/latency_timer").read_text())
    except (OSError, ValueError):
        return None
