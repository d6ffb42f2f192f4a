"""One fault of the process campaign: a bench behind a pseudo-terminal, a real daemon, a client."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import zmq

from sim_device.faults import injection
from sim_device.ports import PortCounts, PtyPort
from sim_device.pty import Server
from smad.client import Client, Refused
from smad.client.endpoints import FOLDER_VARIABLE
from smad.config import (
    Config,
    DaemonConfig,
    LinkConfig,
    RealtimeConfig,
    RecorderConfig,
    TcpConfig,
    config_to_toml,
)
from smad.control.commands import DriveCurrent
from smad.errors import SmadError
from smad.faults.fort import free_ports
from smad.faults.smalldisk import SmallDisk
from smad.faults.trace import HOT, WatchedBench
from smad.processes.daemon import DaemonProcess

PATIENCE_S = 60.0
BAUD = 921_600
_POLL_S = 0.02
_FULL_A = 4.0
_FLOWING_mA = 3500
_HEATED_S = 1.0
_FLUSHED_WITHIN_S = 1.0
"""Four times the recorder's flush interval: a row this old must be in the file."""


class VictimProcess(DaemonProcess):
    """A daemon one part of which breaks on SIGUSR1; see `smad.faults.victim`."""

    def __init__(self, part: str, arguments: Sequence[str], folder: Path) -> None:
        self.folder = folder
        self.bench = "bench"
        self.log = folder / "bench.log"
        words = ["start", "--bench", self.bench, *arguments]
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "smad.faults.victim", part, *words],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                env={**os.environ, FOLDER_VARIABLE: str(folder)},
                start_new_session=True,
            )


class Rig:
    """The bench heats spring X with 4 A under the daemon's command once `heat` returns."""

    def __init__(
        self,
        folder: Path,
        seed: int,
        part: str = "",
        disk: SmallDisk | None = None,
        descriptors: int | None = None,
    ) -> None:
        self.folder = folder
        self.bench = WatchedBench(seed=seed)
        self.disk = disk
        self.runs = folder / "runs" if disk is None else disk.folder
        self._port = folder / "device.tty"
        counts = PortCounts()
        self._server = Server(self.bench, lambda: PtyPort(self._port, counts))
        self._thread = threading.Thread(target=self._server.run, name="bench", daemon=True)
        self._thread.start()
        arguments = ["--config", str(self._write_config(tcp=descriptors is not None))]
        self.daemon = (
            VictimProcess(part, arguments, folder)
            if part
            else DaemonProcess(arguments, folder, descriptors=descriptors)
        )
        self.client: Client | None = None
        self.onset_us = 0
        """Bench time from which on the oracle judges; a fault with several tries moves it."""
        self.programs: list[subprocess.Popen[str]] = []
        self.log: Path | None = None
        self.flushed_rows = 0

    def _write_config(self, *, tcp: bool) -> Path:
        ports = free_ports(2)
        key = zmq.curve_keypair()[0].decode()
        remote = TcpConfig(
            enabled=tcp, command_port=ports[0], stop_port=ports[1], allowed_keys=(key,)
        )
        config = Config(
            daemon=DaemonConfig(tcp=remote),
            link=LinkConfig(port=str(self._port), baud=BAUD, reconnect_interval_s=0.1),
            recorder=RecorderConfig(folder=str(self.runs)),
            # The campaign shares the machine with its simulated bench.
            realtime=RealtimeConfig(fifo_priority=0, lock_memory=False),
        )
        path = self.folder / "bench.toml"
        path.write_text(config_to_toml(config))
        return path

    def heat(self) -> Client:
        """Arm, heat with 4 A, wait until rows of it are flushed. Raises SmadError."""
        client = self.ready()
        self.wait("the board lets itself be armed", lambda: _armed(client))
        client.current(DriveCurrent(i_x_A=_FULL_A))
        self._until_heated(client)
        return client

    def heat_by_program(self, kind: str) -> Client:
        """Let a program of this kind arm and heat; the client returned only watches."""
        client = self.ready()
        self.program(kind)
        self._until_heated(client)
        return client

    def ready(self) -> Client:
        """A client of the daemon once it lets the bench be armed. Raises SmadError."""
        self.daemon.wait_until_ready()
        self.client = client = Client(folder=self.folder, timeout_s=PATIENCE_S, lease_s=None)
        self.wait("the link is up", lambda: client.status().link.state == "monitor")
        return client

    def program(self, kind: str, *more: str) -> subprocess.Popen[str]:
        """Begin a program of `smad.faults.program`; it is killed with the rig at the latest."""
        words = ["-m", "smad.faults.program", str(self.folder), kind, *more]
        program = subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True)
        self.programs.append(program)
        return program

    def _until_heated(self, client: Client) -> None:
        self.wait("4 A flow", self._flowing)
        time.sleep(_HEATED_S)
        recorder = client.status().recorder
        self.log, self.flushed_rows = Path(recorder.path), recorder.rows
        time.sleep(_FLUSHED_WITHIN_S)

    def _flowing(self) -> bool:
        return self.bench.board.outputs.applied_mA[0] > _FLOWING_mA

    def wait(
        self,
        what: str,
        done: Callable[[], bool],
        patience_s: float = PATIENCE_S,
        poll_s: float = _POLL_S,
    ) -> None:
        """Wait for something that must happen. Raises SmadError when it does not."""
        deadline = time.monotonic() + patience_s
        while not done():
            if time.monotonic() > deadline:
                raise SmadError(
                    f"waited in vain until {what}", limit=f"{patience_s:g} s",
                    action=f"the daemon's last line: {self.daemon.last_line}",
                )  # fmt: skip
            time.sleep(poll_s)

    def watch(self, seconds: float, after_stop_s: float) -> None:
        """Let wall time pass, until some time after the bench stopped or at most `seconds`."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if self.bench.board.state not in HOT:
                time.sleep(after_stop_s)
                return
            time.sleep(_POLL_S)

    def inject(self, name: str, **parameters: float) -> None:
        """Break something of the device with the next sample."""
        self.bench.arriving.append(injection(name, 0.0, **parameters))

    def signal(self, number: int) -> None:
        """Send a signal to the daemon."""
        os.kill(self.daemon.process.pid, number)

    def stop_bench(self) -> None:
        """End the bench's thread; its trace does not change any more."""
        self._server.stop()
        self._thread.join(PATIENCE_S)

    def close(self) -> None:
        """End everything."""
        for program in self.programs:
            program.kill()
            program.communicate()
        if self.client is not None:
            self.client.close()
        with contextlib.suppress(ProcessLookupError):
            # One that was stopped would not hear the other signals.
            self.signal(signal.SIGCONT)
        self.daemon.end(signal.SIGKILL)
        self.stop_bench()
        self._server.close()


@contextlib.contextmanager
def rig_in(
    folder: Path,
    seed: int,
    part: str = "",
    disk: SmallDisk | None = None,
    descriptors: int | None = None,
) -> Iterator[Rig]:
    """A rig for as long as the block lasts; its run logs go to `disk`, if one is given.

    With a limit on `descriptors`, the daemon listens on TCP as well.
    """
    rig = Rig(folder, seed, part, disk, descriptors)
    try:
        yield rig
    finally:
        rig.close()


def _armed(client: Client) -> bool:
    try:
        client.arm()
    except Refused:
        return False
    return True
