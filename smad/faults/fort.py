"""A bench in motion under a daemon that hostile clients try: its processes, and its own client."""

from __future__ import annotations

import contextlib
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import zmq

from smad.client import Client, Refused
from smad.client.endpoints import Connection
from smad.config import (
    Config,
    DaemonConfig,
    LinkConfig,
    RealtimeConfig,
    RecorderConfig,
    TcpConfig,
    TelemetryConfig,
    config_to_toml,
)
from smad.control.commands import Sine
from smad.errors import SmadError
from smad.processes.daemon import DaemonProcess
from smad.processes.simulator import simulated_bench

PATIENCE_S = 60.0
POLL_S = 0.02
_MOTION = Sine(amplitude_mm=2.0, period_s=10.0, cycles=10_000)


@dataclass(frozen=True)
class Scale:
    """How much of each attack, and how fast the bench runs (None: real time, not paced)."""

    strangers: int = 20
    messages: int = 10_000
    connections: int = 10_000
    speed: float | None = None


class Fort:
    """A bench in motion under a daemon that listens on ipc and, with keys, on TCP."""

    def __init__(self, folder: Path, port: str, scale: Scale) -> None:
        self.scale = scale
        self.runs = folder / "runs"
        self.friend = tuple(key.decode() for key in zmq.curve_keypair())
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        config = folder / "bench.toml"
        config.write_text(config_to_toml(self._config(port)))
        self.daemon = DaemonProcess(["--config", str(config)], folder)
        self.daemon.wait_until_ready()
        self.client = Client(folder=folder, timeout_s=PATIENCE_S, lease_s=None)
        self.slowest_s = 0.0
        self._listened = 0

    def _config(self, port: str) -> Config:
        ports = free_ports(2)
        tcp = TcpConfig(
            enabled=True, command_port=ports[0], stop_port=ports[1],
            allowed_keys=(self.friend[0],),
        )  # fmt: skip
        return Config(
            link=LinkConfig(port=port, baud=921_600),
            daemon=DaemonConfig(tcp=tcp),
            recorder=RecorderConfig(folder=str(self.runs)),
            telemetry=TelemetryConfig(endpoint=""),
            realtime=RealtimeConfig(fifo_priority=0, lock_memory=False),
        )

    @property
    def connection(self) -> Connection:
        """How to reach the daemon."""
        return self.client.connection

    @property
    def tcp(self) -> tuple[str, int]:
        """Where the command socket listens."""
        host, _, port = self.connection.tcp_command.removeprefix("tcp://").rpartition(":")
        return host, int(port)

    def move(self) -> None:
        """Arm, and move for hours. Raises SmadError when the bench cannot be armed."""
        self.wait("the board lets itself be armed", self._armed)
        self.client.move(_MOTION)

    def _armed(self) -> bool:
        with contextlib.suppress(Refused):
            self.client.arm()
        return self.client.motion().armed

    def wait(self, what: str, done: Callable[[], bool]) -> None:
        """Wait for something, asking the daemon now and then. Raises SmadError."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not done():
            if time.monotonic() > deadline_s:
                raise SmadError(f"waited in vain until {what}", limit=f"{PATIENCE_S:g} s")
            self.breathe(POLL_S)

    def breathe(self, seconds: float) -> None:
        """Let time pass as the rightful client, who wants answers meanwhile."""
        until_s = time.monotonic() + seconds
        while True:
            asked_s = time.monotonic()
            self.client.motion()
            self.slowest_s = max(self.slowest_s, time.monotonic() - asked_s)
            if asked_s >= until_s:
                return
            time.sleep(POLL_S)

    def dial(self, keys: tuple[bytes, bytes] | None) -> zmq.Socket[bytes]:
        """A connection over TCP with these keys, or without any."""
        dealer = self._context.socket(zmq.DEALER)
        dealer.setsockopt(zmq.LINGER, 0)
        if keys is not None:
            dealer.setsockopt(zmq.CURVE_PUBLICKEY, keys[0])
            dealer.setsockopt(zmq.CURVE_SECRETKEY, keys[1])
            dealer.setsockopt(zmq.CURVE_SERVERKEY, self.connection.server_key.encode())
        dealer.connect(self.connection.tcp_command)
        return dealer

    def dial_here(self) -> zmq.Socket[bytes]:
        """A connection over ipc."""
        dealer = self._context.socket(zmq.DEALER)
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.connect(self.connection.command)
        return dealer

    def told(self, words: str) -> bool:
        """Whether the daemon's journal says so since `listen_anew`."""
        return words in self.daemon.log.read_text(errors="replace")[self._listened :]

    def listen_anew(self) -> None:
        """Forget what the journal has said so far."""
        self._listened = len(self.daemon.log.read_text(errors="replace"))

    def close(self) -> None:
        """End everything."""
        self.client.close()
        self._context.destroy(linger=0)
        self.daemon.end()


@contextlib.contextmanager
def fort_of(scale: Scale) -> Iterator[Fort]:
    pace = [] if scale.speed is None else ["--speed", str(scale.speed), "--paced-by-host"]
    # Socket paths are short.
    with tempfile.TemporaryDirectory(prefix="smad-hostile-") as name:
        folder = Path(name)
        with simulated_bench(pace, folder / "tty", waiting=lambda text: None) as port:
            fort = Fort(folder, port, scale)
            try:
                yield fort
            finally:
                fort.close()


def free_ports(count: int) -> list[int]:
    """TCP ports that nobody uses now."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in sockets]
