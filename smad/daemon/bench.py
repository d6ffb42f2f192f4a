"""How quick and steady the daemon is: `python -m smad.daemon.bench [--quick|--hour]`.

Every figure stands beside one of a minimal C program that does the same frame exchange on the same
kind of port under the same load, in interleaved runs, and beside a sentinel that says how late any
real-time thread wakes on this machine. `rows()` returns what is printed.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import firmware_protocol
from smad.api import Status
from smad.cli.daemonprocess import DaemonProcess
from smad.cli.sim import READY
from smad.client import Client, Refused
from smad.config import (
    Config,
    LinkConfig,
    RecorderConfig,
    TelemetryConfig,
    config_to_toml,
)
from smad.control.commands import Sine

Row = tuple[str, float, str]

SETTLE_S = 1.0
REFRESH_S = 1.2
DEVICE_PRIORITY = 85
SENTINEL_PRIORITY = 90
HOGS = 2
SOURCES = Path(__file__).resolve().parents[2] / "bench"
PROTOCOL_C = Path(firmware_protocol.__file__).parent / "c"
LONG_SINE = Sine(amplitude_mm=2.0, period_s=7.0, cycles=1000)


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


@dataclass
class Plan:
    """What is measured, how often and for how long."""

    repeats: int = 5
    seconds: float = 4.0
    memory_minutes: float = 5.0
    compared: tuple[Case, ...] = (
        Case("daemon", 500, True),
        Case("C", 500, True),
        Case("daemon", 500, True, realtime=False),
    )
    single: tuple[Case, ...] = (
        Case("daemon", 100, False),
        Case("daemon", 100, True),
        Case("daemon", 250, True),
        Case("daemon", 500, False),
        Case("C", 500, False),
        Case("daemon", 500, True, transport="socket"),
    )


@dataclass
class Result:
    """Figures of the runs of one case, by name, each a list over the runs."""

    figures: dict[str, list[float]] = field(default_factory=dict)

    def add(self, figures: dict[str, float]) -> None:
        """Take in one run."""
        for name, value in figures.items():
            self.figures.setdefault(name, []).append(value)

    def median(self, name: str) -> float:
        """The median over the runs."""
        return statistics.median(self.figures[name])


class Rig:
    """Processes of one benchmark: compiled programs, devices, daemons, load."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
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
    def device(self, case: Case, *extra: str) -> Iterator[tuple[str, int | None]]:
        """A simulated device; yields its port, or the other end of its socket."""
        ours, theirs = socket.socketpair()
        tty = self.folder / "device.tty"
        wanted = ["--transport", f"fd:{theirs.fileno()}"]
        if case.transport == "pty":
            wanted = ["--symlink", str(tty)]
        command = [sys.executable, "-m", "smad", "sim", "--rate", str(case.rate_hz), *wanted]
        device = subprocess.Popen(
            [*command, *extra],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            pass_fds=(theirs.fileno(),),
        )
        try:
            assert device.stdout is not None
            if not device.stdout.readline().startswith(READY):
                raise RuntimeError("the simulated device did not start; run smad sim to see why")
            if not extra:
                _hurry(device.pid, DEVICE_PRIORITY)
            ours.setblocking(False)
            yield str(tty), ours.fileno() if case.transport != "pty" else None
        finally:
            device.terminate()
            device.communicate()
            ours.close()
            theirs.close()

    def daemon(self, case: Case, port: str, fd: int | None) -> DaemonProcess:
        """A daemon on the port; not yet ready."""
        config = Config(
            link=LinkConfig(port=port, baud=921_600, rate_hz=case.rate_hz),
            recorder=RecorderConfig(folder=str(self.folder / "runs")),
            telemetry=TelemetryConfig(endpoint=""),
        )
        path = self.folder / "bench.toml"
        path.write_text(config_to_toml(config))
        arguments = ["--config", str(path)]
        arguments += [] if case.realtime else ["--no-realtime"]
        arguments += [] if fd is None else ["--fd", str(fd)]
        return DaemonProcess(arguments, self.folder, pass_fds=() if fd is None else (fd,))

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
            subprocess.Popen([sys.executable, "-m", "smad.daemon.benchload", kind, address])
            for kind, address in wanted
        ]
        try:
            yield
        finally:
            for process in running:
                process.kill()
                process.wait()


def measure(rig: Rig, case: Case, seconds: float) -> dict[str, float]:
    """Run one case once; return its figures in microseconds and counts."""
    if case.who == "C":
        return _measure_c(rig, case, seconds)
    with rig.device(case) as (port, fd):
        daemon = rig.daemon(case, port, fd)
        try:
            daemon.wait_until_ready()
            with Client(folder=rig.folder, timeout_s=60.0) as client:
                arm(client)
                client.move(LONG_SINE)
                connection = client.connection
                with rig.load(case, connection.command, connection.telemetry):
                    time.sleep(SETTLE_S)
                    client.reset_timing()
                    before = client.status()
                    late = _sentinel(rig, seconds)
                    after = client.status() if not case.loaded else _patiently(client)
                client.disarm()
        finally:
            daemon.end()
    return {**_figures(before, after, seconds), **late}


def _measure_c(rig: Rig, case: Case, seconds: float) -> dict[str, float]:
    assert rig.echo is not None
    address = f"ipc://{rig.folder}/answer"
    priority = "80" if case.realtime else "0"
    with rig.device(case) as (port, fd), rig.load(case, address, ""):
        name = port if fd is None else f"fd:{fd}"
        run = subprocess.Popen(
            [str(rig.echo), name, str(seconds + SETTLE_S), priority],
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=() if fd is None else (fd,),
        )
        late = _sentinel(rig, seconds)
        out, _ = run.communicate()
    found = json.loads(out)
    return {
        "own p50": found["p50_us"],
        "own p99": found["p99_us"],
        "own p99.9": found["p999_us"],
        "missed": found["missed"],
        "samples": found["samples"],
        **late,
    }


def _figures(before: Status, after: Status, seconds: float) -> dict[str, float]:
    share, age, jitter = after.timing.own_share, after.timing.setpoint_age, after.timing.jitter
    counts, earlier = after.counts, before.counts
    return {
        "own p50": share.p50_us,
        "own p99": share.p99_us,
        "own p99.9": share.p999_us,
        "age p50": age.p50_us,
        "age p99": age.p99_us,
        "age p99.9": age.p999_us,
        "jitter p99": jitter.p99_us,
        "jitter p99.9": jitter.p999_us,
        "missed": counts.missed - earlier.missed,
        "skipped": counts.skipped - earlier.skipped,
        "samples": counts.samples - earlier.samples,
        "commands/s": (counts.commands - earlier.commands) / (seconds + REFRESH_S),
    }


def _sentinel(rig: Rig, seconds: float) -> dict[str, float]:
    """Let the time pass; return how late a real-time thread woke on each core, worst of both."""
    cores = range(os.cpu_count() or 1)
    if rig.sentinel is None:
        time.sleep(seconds)
        return {}
    running = [
        subprocess.Popen(
            [str(rig.sentinel), str(seconds), str(SENTINEL_PRIORITY), str(core)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        for core in cores
    ]
    found = [json.loads(process.communicate()[0]) for process in running]
    return {
        "sentinel p99": max(f["p99_us"] for f in found),
        "sentinel p99.9": max(f["p999_us"] for f in found),
    }


def _patiently(client: Client) -> Status:
    # The percentiles are worked out once a second.
    time.sleep(REFRESH_S)
    return client.status()


def arm(client: Client) -> None:
    """Arm as soon as the board allows it."""
    deadline = time.monotonic() + 60.0
    while True:
        try:
            client.arm()
        except Refused:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)
        else:
            return


def _hurry(process: int, priority: int) -> None:
    with contextlib.suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(priority))


def command_rows(rig: Rig, calls: int) -> list[Row]:
    """Round trip of a command, and `smad status` from start to prompt."""
    case = Case("daemon", 100, False)
    with rig.device(case) as (port, fd):
        daemon = rig.daemon(case, port, fd)
        try:
            daemon.wait_until_ready()
            with Client(folder=rig.folder) as client:
                client.motion()
                trips = sorted(_timed(client.motion) for _ in range(calls))
            starts = sorted(_timed(lambda: _status_command(rig.folder)) for _ in range(10))
        finally:
            daemon.end()
    return [
        ("command round trip p50", trips[calls // 2] * 1e6, "us"),
        ("command round trip p99", trips[calls * 99 // 100] * 1e6, "us"),
        ("smad status, start to prompt, median of 10", starts[5] * 1e3, "ms"),
        ("smad status, start to prompt, slowest of 10", starts[-1] * 1e3, "ms"),
    ]


def _timed(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def _status_command(folder: Path) -> None:
    subprocess.run(
        [str(Path(sys.executable).parent / "smad"), "status"],
        env={**os.environ, "SMAD_RUNTIME_DIR": str(folder)},
        stdout=subprocess.DEVNULL,
        check=True,
    )


def memory_rows(rig: Rig, minutes: float) -> list[Row]:
    """Resident memory of the daemon over so much board time at 500 Hz, faster than real time."""
    case = Case("daemon", 500, False, realtime=False)
    with rig.device(case, "--speed", "6", "--paced-by-host") as (port, fd):
        daemon = rig.daemon(case, port, fd)
        try:
            daemon.wait_until_ready()
            with Client(folder=rig.folder, timeout_s=60.0) as client:
                return _memory_over(client, minutes)
        finally:
            daemon.end()


def _memory_over(client: Client, minutes: float) -> list[Row]:
    began = time.monotonic()
    first: float | None = None
    stretch_s = min(600.0, minutes * 30.0)
    stretches = round(minutes * 60.0 / stretch_s)
    for number in range(stretches):
        arm(client)
        client.move(
            Sine(amplitude_mm=2.0, period_s=stretch_s / 40, cycles=40),
        )
        client.wait_until_done()
        client.disarm()
        if first is None:
            first = client.status().memory_MiB
        _say(f"memory: {number + 1} of {stretches} stretches of {stretch_s:.0f} s board time")
    status = client.status()
    assert first is not None
    return [
        (f"memory after {stretch_s / 60:g} min of board time at 500 Hz", first, "MiB"),
        (f"memory after {minutes:g} min of board time at 500 Hz", status.memory_MiB, "MiB"),
        ("samples in that time", float(status.counts.samples), ""),
        ("missed in that time", float(status.counts.missed), ""),
        ("faster than real time by", minutes * 60.0 / (time.monotonic() - began), ""),
    ]


def rows(plan: Plan | None = None) -> list[Row]:
    """Measure everything; return (name, value, unit) of each figure."""
    chosen = plan or Plan()
    results: dict[Case, Result] = {}
    with tempfile.TemporaryDirectory(prefix="smad-bench-") as place:
        rig = Rig(Path(place))
        cases = [case for _ in range(chosen.repeats) for case in chosen.compared]
        for number, case in enumerate([*chosen.single, *cases]):
            if case.who == "C" and rig.echo is None:
                continue
            _say(f"{number + 1} of {len(chosen.single) + len(cases)}: {case.name}")
            results.setdefault(case, Result()).add(measure(rig, case, chosen.seconds))
        rest = command_rows(rig, 2000) + memory_rows(rig, chosen.memory_minutes)
    table = [
        (f"{case.name}: {name}", result.median(name), "" if _is_count(name) else "us")
        for case, result in results.items()
        for name in result.figures
    ]
    return [*table, *_ratios(results, chosen.compared), *rest]


def _is_count(name: str) -> bool:
    return name in ("missed", "skipped", "samples", "commands/s")


def _ratios(results: dict[Case, Result], compared: Sequence[Case]) -> list[Row]:
    reference = next((c for c in compared if c.who == "C"), None)
    if reference is None or reference not in results:
        return []
    base = results[reference].median("own p99.9")
    return [
        (f"{case.name}: own p99.9 over C's", results[case].median("own p99.9") / base, "")
        for case in compared
        if case is not reference
    ]


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(arguments: Sequence[str]) -> None:
    """Print the rows."""
    plan = Plan()
    if "--quick" in arguments:
        plan = Plan(repeats=2, seconds=2.0, memory_minutes=1.0)
    if "--hour" in arguments:
        plan = Plan(memory_minutes=60.0)
    for name, value, unit in rows(plan):
        print(f"{name:<66}{value:>12.4g} {unit}")


if __name__ == "__main__":
    main(sys.argv[1:])
