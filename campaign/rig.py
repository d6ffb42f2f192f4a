"""A daemon process on a simulated bench, and a client of it.

The fault campaign, the soak, the hostile clients and the benchmarks run on this rig; each brings
its simulated bench. `campaign.virtual` is the daemon on virtual time, in one process.
"""

from __future__ import annotations

import contextlib
import signal
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from smad.client import Client
from smad.client.arming import arm_when_allowed
from smad.config import (
    Config,
    LinkConfig,
    RealtimeConfig,
    RecorderConfig,
    TcpConfig,
    TelemetryConfig,
    config_to_toml,
)
from smad.errors import SmadError
from smad.processes.daemon import SMAD, DaemonProcess

PATIENCE_S = 60.0
POLL_S = 0.02
BAUD = 921_600


def rig_config(folder: Path, port: str, **sections: Any) -> Config:
    """Return a configuration that records below `folder`; `sections` replace its sections.

    No telemetry over TCP and no real-time priority: the rig shares the machine with its bench.
    """
    defaults: dict[str, Any] = {
        "link": LinkConfig(port=port, baud=BAUD),
        "recorder": RecorderConfig(folder=str(folder / "runs")),
        "telemetry": TelemetryConfig(endpoint=""),
        "realtime": RealtimeConfig(fifo_priority=0, lock_memory=False),
    }
    return Config(**{**defaults, **sections})


def start_daemon(
    folder: Path,
    config: Config,
    arguments: Sequence[str] = (),
    *,
    program: Sequence[str] = SMAD,
    descriptors: int | None = None,
    pass_fds: Sequence[int] = (),
) -> DaemonProcess:
    """Write the configuration into `folder` and start a daemon with it; it is not yet ready."""
    path = folder / "bench.toml"
    path.write_text(config_to_toml(config))
    return DaemonProcess(
        ["--config", str(path), *arguments],
        folder,
        program=program,
        descriptors=descriptors,
        pass_fds=pass_fds,
    )


class DaemonRig:
    """A daemon in `folder` and its client, which is connected by `connect`."""

    def __init__(self, folder: Path, daemon: DaemonProcess) -> None:
        self.folder = folder
        self.daemon = daemon
        self._client: Client | None = None

    @property
    def client(self) -> Client:
        """The client, without a lease. Raises SmadError before `connect`."""
        if self._client is None:
            raise SmadError("the rig's client is not connected", action="call connect first")
        return self._client

    def connect(self) -> Client:
        """Wait until the daemon answers and connect the client. Raises SmadError."""
        self.daemon.wait_until_ready()
        self._client = Client(folder=self.folder, timeout_s=PATIENCE_S, lease_s=None)
        return self._client

    def arm(self) -> None:
        """Arm as soon as the board allows it. Raises Refused after `PATIENCE_S`."""
        arm_when_allowed(self.client, PATIENCE_S)

    def wait(
        self,
        what: str,
        done: Callable[[], bool],
        patience_s: float = PATIENCE_S,
        pause: Callable[[], None] = lambda: time.sleep(POLL_S),
    ) -> None:
        """Wait for something that must happen. Raises SmadError when it does not."""
        deadline_s = time.monotonic() + patience_s
        while not done():
            if time.monotonic() > deadline_s:
                raise SmadError(
                    f"waited in vain until {what}",
                    limit=f"{patience_s:g} s",
                    action=f"the daemon's last line: {self.daemon.last_line}",
                )
            pause()

    def close(self) -> None:
        """Close the client and end the daemon, even one that is stopped by SIGSTOP."""
        if self._client is not None:
            self._client.close()
        with contextlib.suppress(ProcessLookupError):
            self.daemon.process.send_signal(signal.SIGCONT)
        self.daemon.end(signal.SIGKILL)


def tcp_config(key: str) -> TcpConfig:
    """Return a configuration that listens on TCP, on free ports, for the client of this key."""
    command, stop = free_ports(2)
    return TcpConfig(enabled=True, command_port=command, stop_port=stop, allowed_keys=(key,))


def free_ports(count: int) -> list[int]:
    """Return TCP ports that nobody uses now."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for opened in sockets:
            opened.bind(("127.0.0.1", 0))
        return [int(opened.getsockname()[1]) for opened in sockets]
