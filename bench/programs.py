"""The processes of the benchmark: compiled programs, simulated devices, daemons, load."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import firmware_protocol
from campaign.rig import BAUD, rig_config, start_daemon
from smad.config import Config, LinkConfig, RealtimeConfig
from smad.processes.daemon import DaemonProcess
from smad.processes.simulator import READY

DEVICE_PRIORITY = 85
SENTINEL_PRIORITY = 90
HOGS = 2
ARM_DEADLINE_S = 60.0
SOURCES = Path(__file__).resolve().parent
PROTOCOL_C = Path(firmware_protocol.__file__).parent / "c"


@dataclass(frozen=True)
class Case:
    """One way to run: who answers, how fast, under which load and scheduling, over what."""

    who: str
    rate_hz: Literal[100, 250, 500]
    loaded: bool
    realtime: bool = True
    transport: str = "pty"

    @property
    def name(self) -> str:
        """The case in words."""
        load = "load" if self.loaded else "idle"
        plain = "" if self.realtime else ", ordinary scheduling"
        return f"{self.who}, {self.rate_hz} Hz, {load}, {self.transport}{plain}"


class Programs:
    """Programs of one benchmark: compiled ones, devices, daemons (`campaign.rig`), load."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.trace = folder / "trace"
        self.echo = self._compile("echo", with_protocol=True)
        self.sentinel = self._compile("sentinel", with_protocol=False)

    def _compile(self, name: str, *, with_protocol: bool) -> Path | None:
        source, compiler = SOURCES / f"{name}.c", shutil.which("cc")
        if compiler is None or not source.exists():
            return None
        program = self.folder / name
        extra = [f"-I{PROTOCOL_C}", str(PROTOCOL_C / "smad_protocol.c")] if with_protocol else []
        subprocess.run(
            [compiler, "-O2", "-std=gnu99", str(source), *extra, "-o", str(program)], check=True
        )
        return program

    @contextlib.contextmanager
    def device(
        self, case: Case, *extra: str, axes: int = 1
    ) -> Iterator[tuple[str, tuple[int, ...]]]:
        """A simulated device; yields its port, or the other ends of the sockets of its axes."""
        pairs = [socket.socketpair() for _ in range(axes)]
        tty = self.folder / "device.tty"
        numbers = tuple(theirs.fileno() for _, theirs in pairs)
        wanted = ["--transport", f"fd:{_listed(numbers)}"]
        if case.transport == "pty":
            wanted = ["--symlink", str(tty)]
        command = [sys.executable, "-m", "smad", "sim", "--rate", str(case.rate_hz), *wanted]
        device = subprocess.Popen(
            [*command, *extra, *(("--axes", str(axes)) if axes > 1 else ())],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            pass_fds=numbers,
        )
        try:
            assert device.stdout is not None
            if not device.stdout.readline().startswith(READY):
                raise RuntimeError("the simulated device did not start; run smad sim to see why")
            if "--speed" not in extra:
                hurry(device.pid, DEVICE_PRIORITY)
            for ours, _ in pairs:
                ours.setblocking(False)
            ends = tuple(ours.fileno() for ours, _ in pairs)
            yield str(tty), ends if case.transport != "pty" else ()
        finally:
            device.terminate()
            device.communicate()
            for pair in pairs:
                for end in pair:
                    end.close()

    def sentinels(self, seconds: float) -> list[Path]:
        """Run the sentinel on every core for so long; return the files they wrote."""
        if self.sentinel is None:
            time.sleep(seconds)
            return []
        files = [self.folder / f"sentinel-{core}" for core in range(os.cpu_count() or 1)]
        running = [
            subprocess.Popen(
                [
                    *(str(self.sentinel), str(seconds), str(SENTINEL_PRIORITY)),
                    *(str(core), str(file)),
                ],
                stderr=subprocess.DEVNULL,
            )
            for core, file in enumerate(files)
        ]
        for process in running:
            process.wait()
        return files

    def daemon(self, case: Case, port: str, fds: tuple[int, ...]) -> DaemonProcess:
        """A daemon on the port; not yet ready."""
        config = rig_config(
            self.folder,
            port,
            link=LinkConfig(port=port, baud=BAUD, rate_hz=case.rate_hz),
            realtime=RealtimeConfig(),
        )
        arguments = ["--trace", str(self.trace)]
        arguments += [] if case.realtime else ["--no-realtime"]
        return self.started(config, arguments, fds)

    def started(
        self, config: Config, arguments: Sequence[str], fds: tuple[int, ...]
    ) -> DaemonProcess:
        """A daemon, on sockets where there are any."""
        sockets = ["--fd", _listed(fds)] if fds else []
        return start_daemon(self.folder, config, [*arguments, *sockets], pass_fds=fds)

    @contextlib.contextmanager
    def load(self, case: Case, command: str, telemetry: str) -> Iterator[None]:
        """Two hogs, a flood of commands, a subscriber that never reads; nothing when idle."""
        wanted: list[tuple[str, str]] = []
        if case.loaded:
            wanted += [("hog", "-")] * HOGS
            wanted += [("flood", command)]
            if telemetry:
                wanted += [("deaf", telemetry)]
            else:
                wanted += [("answer", command)]
        running = [
            subprocess.Popen([sys.executable, "-m", "bench.daemon_load", kind, address])
            for kind, address in wanted
        ]
        try:
            yield
        finally:
            for process in running:
                process.kill()
                process.wait()


def _listed(numbers: Sequence[int]) -> str:
    return ",".join(map(str, numbers))


def hurry(process: int, priority: int) -> None:
    """Give a process real-time priority, where that is allowed."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(priority))
