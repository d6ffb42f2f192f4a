"""A bench in motion under a daemon that hostile clients attack, and the rightful client."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import zmq

from campaign.rig import PATIENCE_S, POLL_S, DaemonRig, rig_config, start_daemon, tcp_config
from smad.client.endpoints import Connection
from smad.config import DaemonConfig
from smad.control.commands import Sine
from smad.processes.simulator import simulated_bench

_MOTION = Sine(amplitude_mm=2.0, period_s=10.0, cycles=10_000)
_PATIENCE = "20"
"""Times as long as usual that daemon and bench wait for each other, 2 s: 40 s."""


@dataclass(frozen=True)
class Scale:
    """How much of each attack, and how fast the bench runs (None: real time, not paced)."""

    strangers: int = 20
    messages: int = 10_000
    connections: int = 10_000
    speed: float | None = None

    @property
    def patience(self) -> tuple[str, ...]:
        """Options of daemon and bench: a busy machine makes a paced bench slower, never wrong."""
        return () if self.speed is None else ("--patience", _PATIENCE)


class HostileRig(DaemonRig):
    """A bench in motion under a daemon that listens on ipc and, for `friend`'s key, on TCP."""

    def __init__(self, folder: Path, port: str, scale: Scale) -> None:
        self.scale = scale
        self.friend = tuple(key.decode() for key in zmq.curve_keypair())
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        daemon = DaemonConfig(tcp=tcp_config(self.friend[0]))
        config = rig_config(folder, port, daemon=daemon)
        super().__init__(folder, start_daemon(folder, config, scale.patience))
        self.slowest_s = 0.0
        self._heard_until = 0
        self.connect()

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
        self.arm()
        self.client.move(_MOTION)

    def wait(
        self,
        what: str,
        done: Callable[[], bool],
        patience_s: float = PATIENCE_S,
        pause: Callable[[], None] | None = None,
    ) -> None:
        """Wait, asking the daemon now and then. Raises SmadError."""
        super().wait(what, done, patience_s, pause or (lambda: self.breathe(POLL_S)))

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

    def journal_says(self, words: str) -> bool:
        """Return whether the daemon's journal says so since `forget_journal`."""
        return words in self.daemon.log.read_text(errors="replace")[self._heard_until :]

    def forget_journal(self) -> None:
        """Forget what the journal has said so far."""
        self._heard_until = len(self.daemon.log.read_text(errors="replace"))

    def close(self) -> None:
        """Close all connections and end the daemon."""
        self._context.destroy(linger=0)
        super().close()


@contextlib.contextmanager
def hostile_rig(scale: Scale) -> Iterator[HostileRig]:
    pace = [] if scale.speed is None else ["--speed", str(scale.speed), "--paced-by-host"]
    # Socket paths are short.
    with tempfile.TemporaryDirectory(prefix="smad-hostile-") as name:
        folder = Path(name)
        with simulated_bench(
            [*pace, *scale.patience], folder / "tty", waiting=lambda text: None
        ) as port:
            rig = HostileRig(folder, port, scale)
            try:
                yield rig
            finally:
                rig.close()
