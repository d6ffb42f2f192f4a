"""Processes for the tests on real pseudo-terminals: a device, and daemons on it.

A test marked EVERY_DEVICE runs against the Python board, the C firmware as a process, and the
firmware on an emulated chip; and, where SMAD_HIL_PORT names a serial port, against the board there
(SMAD_HIL_BAUD is its speed). That one heats: read docs/firmware-wiring.md first.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from sim_device.firmware.build import PORTS, reason_to_skip
from smad.api import Status
from smad.client import Client, Refused
from smad.config import (
    Config,
    LinkConfig,
    RealtimeConfig,
    RecorderConfig,
    TelemetryConfig,
    config_to_toml,
)
from smad.processes.daemon import DaemonProcess
from smad.processes.simulator import PACED

REAL_PORT = os.environ.get("SMAD_HIL_PORT", "")
REAL_BAUD = int(os.environ.get("SMAD_HIL_BAUD", "500000"))
EVERY_DEVICE = pytest.mark.parametrize(
    "hil", ["python", "host", "avr", *(["port"] if REAL_PORT else [])], indirect=True
)

PATIENCE_S = 240.0
"""A loaded machine may take its time; nothing is asserted on how long anything took."""
LEASE_S = 120.0


class Device:
    """A `smad sim` process; `port` is a lasting name of its tty."""

    def __init__(self, folder: Path, arguments: Sequence[str]) -> None:
        self.port = folder / "device.tty"
        self._arguments = arguments
        self._process: subprocess.Popen[str] | None = None
        self.start()

    def start(self, *arguments: str) -> None:
        """Start it (again), with other arguments if any are given."""
        command = [sys.executable, "-m", "smad", "sim", "--symlink", str(self.port)]
        self._process = subprocess.Popen(
            [*command, *(arguments or self._arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline().startswith("ready")

    def kill(self) -> None:
        """The power goes: no goodbye, and the port's name goes with it, as that of a USB port does.

        Under a name left behind a daemon would find the next pseudo-terminal of that number, which
        another test may have.
        """
        if self._process is not None:
            self.port.unlink(missing_ok=True)
            self._process.kill()
            self._process.communicate()
            self._process = None


class RealPort:
    """The board on a real port, whose power no test can switch. What is asked for the simulation
    alone, its speed for one, is not asked of it."""

    port = Path(REAL_PORT)

    def start(self, *arguments: str) -> None:
        """It is running."""

    def kill(self) -> None:
        """Nobody is there to pull the plug."""
        pytest.skip("a real board's power cannot be cut by a test")


class Hil:
    """A folder with a device, daemons and clients; everything ends with the test."""

    def __init__(self, folder: Path, kind: str = "python") -> None:
        self.folder = folder
        self.kind = kind
        self.runs = folder / "runs"
        self._devices: list[Device] = []
        self._daemons: list[DaemonProcess] = []
        self._clients: list[Client] = []
        self._patient: tuple[str, ...] = ()

    def device(self, *arguments: str) -> Device | RealPort:
        """A device; unless told otherwise eight times as fast as the wall clock, if the machine
        can, and paced by its host."""
        if self.kind == "port":
            return RealPort()
        chosen = list(arguments or ("--speed", "8", PACED[0]))
        if PACED[0] in chosen:
            self._patient = PACED[1:]
            chosen += PACED[1:]
        if self.kind != "python":
            chosen += ["--firmware", self.kind, "--store", str(self.folder / "store")]
        device = Device(self.folder, chosen)
        self._devices.append(device)
        return device

    def write_config(self, port: object, bench: str = "bench") -> Path:
        """Write the configuration of a daemon on a port; return its path."""
        config = Config(
            link=LinkConfig(
                port=str(port),
                baud=REAL_BAUD if self.kind == "port" else 921_600,
                reconnect_interval_s=0.05,
            ),
            recorder=RecorderConfig(folder=str(self.runs), automatic=False),
            telemetry=TelemetryConfig(endpoint=""),
            # Faster than the wall clock, it needs no priority, and would starve the machine.
            realtime=RealtimeConfig(fifo_priority=0, lock_memory=False),
        )
        path = self.folder / f"{bench}.toml"
        path.write_text(config_to_toml(config))
        return path

    def daemon(
        self,
        port: object,
        *arguments: str,
        bench: str = "bench",
        environment: Mapping[str, str] | None = None,
    ) -> DaemonProcess:
        """A daemon on a port; not yet ready."""
        path = self.write_config(port, bench)
        daemon = DaemonProcess(
            ["--config", str(path), *arguments], self.folder, bench=bench, environment=environment
        )
        self._daemons.append(daemon)
        return daemon

    def ready_daemon(self, port: object, *arguments: str) -> DaemonProcess:
        """A daemon that answers commands."""
        daemon = self.daemon(port, *arguments, *self._patient)
        daemon.wait_until_ready()
        return daemon

    def client(self, **options: Any) -> Client:
        """A client of the daemon."""
        client = Client(folder=self.folder, timeout_s=PATIENCE_S, **{"lease_s": LEASE_S} | options)
        self._clients.append(client)
        return client

    def close(self) -> None:
        """End everything."""
        for client in self._clients:
            client.close()
        for daemon in self._daemons:
            daemon.end()
            # Shown by pytest when the test fails.
            print(daemon.log.read_text(errors="replace"))
        for device in self._devices:
            device.kill()


@pytest.fixture
def hil(request: pytest.FixtureRequest) -> Iterator[Hil]:
    kind = getattr(request, "param", "python")
    if kind in PORTS:
        reason = reason_to_skip(kind)
        if reason:
            pytest.skip(reason)
    # Socket paths are short; pytest's own folders are not.
    with tempfile.TemporaryDirectory(prefix="smad-hil-") as folder:
        hil = Hil(Path(folder), kind)
        try:
            yield hil
        finally:
            hil.close()


def wait_for(client: Client, condition: Callable[[Status], bool]) -> Status:
    """Poll the status until the condition holds."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        status = client.status()
        if condition(status):
            return status
        time.sleep(0.02)
    raise AssertionError(f"it never came; the last status was {status}")


def arm(client: Client) -> None:
    """Arm as soon as the board allows it. A real board keeps the fault of the test before."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            client.arm()
        except Refused:
            if time.monotonic() > deadline:
                raise
            with contextlib.suppress(Refused):
                client.clear()
            time.sleep(0.05)
        else:
            return
