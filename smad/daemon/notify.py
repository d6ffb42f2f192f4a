"""sd_notify: tells systemd that the daemon is ready, alive, and what it is doing."""

import contextlib
import os
import socket
from collections.abc import Mapping


class Notifier:
    """Datagrams to systemd's socket; does nothing when there is none.

    `watchdog_us` is how often systemd wants to hear from us, or 0. The control task feeds it, so
    that a loop that has stopped stepping is noticed.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        self._next_us = 0
        self.watchdog_us = 0
        address = environment.get("NOTIFY_SOCKET", "")
        if not address.startswith(("/", "@")):
            return
        self._socket = socket.socket(
            socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK
        )
        self._address = "\0" + address[1:] if address.startswith("@") else address
        ours = str(os.getpid())
        if environment.get("WATCHDOG_PID", ours) == ours:
            with contextlib.suppress(ValueError):
                self.watchdog_us = max(0, int(environment.get("WATCHDOG_USEC", "0")))

    def ready(self, status: str) -> None:
        """Say that commands are answered from now on."""
        self._send(f"READY=1\nSTATUS={status}")

    def stopping(self, text: str) -> None:
        """Say that the daemon is on its way out."""
        self._send(f"STOPPING=1\nSTATUS={text}")

    def alive(self, now_us: int) -> None:
        """Feed the watchdog, twice in each of its intervals at most."""
        if self.watchdog_us and now_us >= self._next_us:
            self._next_us = now_us + self.watchdog_us // 3
            self._send("WATCHDOG=1")

    def _send(self, message: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(message.encode(), self._address)
