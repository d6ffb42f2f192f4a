"""How quick the daemon is with several axes: `python -m bench.axes [--axes N] [--rate HZ] …`.

For each number of axes, `--pairs` times: the daemon, and beside it the minimal C program, one for
each board, on ports of the same kind. All axes follow sinusoids that begin together, again and
again. With `--load` the machine is kept busy meanwhile by two processes that compute, a flood of
commands and a subscriber that never reads. Steps of moments at which the machine itself was away
are left out, as in `bench.daemon`. Afterwards a third client stops the bench again and again: from
its call until the reply, which comes when no board is armed.

Ten minutes of six axes: `--axes 6 --seconds 600 --load`, and the same with `--rate 250`. An hour of
board time, as fast as it goes: `--axes 6 --memory 60`.

On a pseudo-terminal (`--transport pty`) workers of the kernel hand the bytes on, at ordinary
priority: what else the machine does keeps them waiting, and shows in every stop. Through sockets
what is measured is the daemon.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple

import click

from bench.daemon import REFRESH_S, SETTLE_S, Result, Row, memory_over, percentile
from bench.programs import ARM_DEADLINE_S, Case, Programs, hurry
from bench.stop_latency import STOPPER_PRIORITY, armed_and_driven
from campaign.rig import BAUD, rig_config
from smad.api import Status
from smad.client import Client
from smad.client.arming import arm_when_allowed
from smad.config import AxisConfig, LinkConfig, RealtimeConfig
from smad.config.axes import USUAL_NAMES
from smad.control.commands import Sine
from smad.daemon.trace import load

PERIOD_S = 2.0
SINE = Sine(amplitude_mm=1.0, period_s=PERIOD_S, cycles=5)
SPEED = "6"
OWN_GOAL_US = {0.99: 400.0, 0.999: 1000.0}
STOP_GOAL_MS = 20.0
C_MOST_S = 60.0
"""The C program shows what the machine does: a minute has its tails, too."""


class AxesBench(NamedTuple):
    """So many boards at a rate: the ports by axis; one board alone has no name."""

    programs: Programs
    case: Case
    ports: dict[str, str]
    fds: tuple[int, ...]
    """The sockets to the boards, by axis, in place of ports."""

    @property
    def name(self) -> str:
        """It in words."""
        load_ = "load" if self.case.loaded else "idle"
        axes = "1 axis" if len(self.ports) == 1 else f"{len(self.ports)} axes"
        return f"{axes}, {self.case.rate_hz} Hz, {load_}, {self.case.transport}"

    @contextlib.contextmanager
    def daemon(self) -> Iterator[Client]:
        """A daemon on all boards, and a client of it."""
        alone = self.ports.get("", "")
        config = rig_config(
            self.programs.folder,
            alone,
            link=LinkConfig(port=alone, baud=BAUD, rate_hz=self.case.rate_hz),
            realtime=RealtimeConfig(),
            axes=tuple(AxisConfig(name=n, port=p) for n, p in self.ports.items() if n),
        )
        arguments = ["--trace", str(self.programs.trace)]
        arguments += [] if self.case.realtime else ["--no-realtime"]
        daemon = self.programs.started(config, arguments, self.fds)
        try:
            daemon.wait_until_ready()
            with Client(folder=self.programs.folder, timeout_s=60.0) as client:
                yield client
        finally:
            daemon.end()

    def begin(self, client: Client, sine: Sine = SINE) -> None:
        """Let all axes begin a sinusoid together."""
        client.move(dict.fromkeys(self.ports, sine)) if len(self.ports) > 1 else client.move(sine)


@contextlib.contextmanager
def boards(programs: Programs, case: Case, count: int, *extra: str) -> Iterator[AxesBench]:
    """So many simulated boards, which no other process keeps waiting."""
    with programs.device(case, *extra, axes=count) as (port, fds):
        names = {name: f"{port}.{name}" for name in USUAL_NAMES[:count]}
        ports = names if count > 1 else {"": port}
        if fds:
            ports = {name: f"fd:{fd}" for name, fd in zip(ports, fds, strict=True)}
        yield AxesBench(programs, case, ports, fds)


class Followed:
    """Begins motions together and looks at the memory while a stretch is measured."""

    def __init__(self, bench: AxesBench, client: Client) -> None:
        self.memory_MiB: list[tuple[float, float]] = []
        self._bench = bench
        self._client = client
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow)

    def __enter__(self) -> Followed:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._thread.join()

    def _follow(self) -> None:
        begun_s = time.monotonic()
        while not self._over.wait(PERIOD_S):
            self._bench.begin(self._client)
            self.memory_MiB.append((time.monotonic() - begun_s, self._client.status().memory_MiB))


def run_daemon(bench: AxesBench, seconds: float, result: Result) -> list[Row]:
    """Take in a stretch of the daemon; return what it has beside its steps."""
    with bench.daemon() as client:
        arm_when_allowed(client, ARM_DEADLINE_S)
        bench.begin(client)
        connection = client.connection
        with bench.programs.load(bench.case, connection.command, connection.telemetry):
            time.sleep(SETTLE_S)
            client.reset_timing()
            before = client.status()
            with Followed(bench, client) as followed:
                files = bench.programs.sentinels(seconds)
                time.sleep(REFRESH_S)
            after = client.status()
        client.disarm()
    _take(bench, result, files)
    return _rows(bench, before, after, followed.memory_MiB)


def run_c(bench: AxesBench, seconds: float, result: Result) -> None:
    """Take in a stretch of the C program, one for each board, under the same load."""
    assert bench.programs.echo is not None
    traces = [bench.programs.folder / f"trace-{k}" for k in range(len(bench.ports))]
    with bench.programs.load(bench.case, f"ipc://{bench.programs.folder}/answer", ""):
        running = [
            subprocess.Popen(
                [str(bench.programs.echo), port, str(seconds + 2 * SETTLE_S), "80", str(trace)],
                stdout=subprocess.DEVNULL,
                pass_fds=bench.fds,
            )
            for port, trace in zip(bench.ports.values(), traces, strict=True)
        ]
        time.sleep(SETTLE_S)
        files = bench.programs.sentinels(seconds)
        for process in running:
            process.wait()
    bench.programs.trace.write_bytes(b"".join(trace.read_bytes() for trace in traces))
    _take(bench, result, files)


def _take(bench: AxesBench, result: Result, files: list[Path]) -> None:
    lateness = [load(file) for file in files]
    steps = load(bench.programs.trace)
    if lateness:
        first, last = lateness[0][0][0], lateness[0][-1][0]
        steps = [pair for pair in steps if first <= pair[0] <= last]
    result.add(steps, lateness, {})


def _rows(
    bench: AxesBench, before: Status, after: Status, memory_MiB: list[tuple[float, float]]
) -> list[Row]:
    earlier = before.parts()
    counts = {name: part.counts for name, part in after.parts().items()}

    def more(what: str) -> float:
        return float(
            sum(getattr(c, what) - getattr(earlier[n].counts, what) for n, c in counts.items())
        )

    ages = [part.timing.setpoint_age.p99_us for part in after.parts().values()]
    rows = [Row("samples", more("samples"), ""), Row("missed samples", more("missed"), "")]
    rows += [Row("skipped samples", more("skipped"), "")]
    rows += [Row("setpoint age p99, of the slowest axis", max(ages) / 1e3, "ms")]
    if after.skew:
        one_ms = 1e3 / bench.case.rate_hz
        rows += [
            Row(
                f"skew of {after.skew.count} begins {what} (one sample: {one_ms:g} ms)",
                us / 1e3,
                "ms",
            )
            for what, us in (
                ("p50", after.skew.p50_us),
                ("p99", after.skew.p99_us),
                ("most", after.skew.max_us),
            )
        ]
    for at_s, MiB in (memory_MiB[0], memory_MiB[-1]) if memory_MiB else ():
        rows.append(Row(f"memory after {at_s:.0f} s", MiB, "MiB"))
    return rows


def stops_ms(bench: AxesBench, stops: int) -> list[float]:
    """Stop again and again by another client, under the load; return how long each took, sorted."""
    taken = []
    with (
        bench.daemon() as first,
        bench.programs.load(bench.case, first.connection.command, first.connection.telemetry),
    ):
        # Who stops is kept waiting by nobody; what was begun before stays ordinary. So do threads:
        # those of a client that passes its bytes on begin with it.
        hurry(os.getpid(), STOPPER_PRIORITY)
        folder = bench.programs.folder
        try:
            with (
                Client(folder=folder, timeout_s=60.0) as owner,
                Client(folder=folder, timeout_s=60.0) as third,
            ):
                for n in range(stops):
                    armed_and_driven(owner, tuple(bench.ports))
                    time.sleep(0.02 + 0.01 * (n * 0.618 % 1.0))
                    began_s = time.perf_counter()
                    motion = third.disarm()
                    taken.append((time.perf_counter() - began_s) * 1e3)
                    if motion.armed:
                        raise SystemExit(f"a stop replied while a board was armed: {motion.mode}")
        finally:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return sorted(taken)


def memory_rows(bench: AxesBench, minutes: float) -> list[Row]:
    """Resident memory of the daemon over so much board time, faster than real time."""
    with bench.daemon() as client:
        return memory_over(
            client, minutes, lambda sine: bench.begin(client, sine), bench.case.rate_hz
        )


def measure(bench: AxesBench, seconds: float, pairs: int, stops: int) -> Iterator[Row]:
    """Yield the figures of a bench."""
    ours, theirs, rest = Result(), Result(), list[Row]()
    for number in range(pairs):
        print(f"{bench.name}: {number + 1} of {pairs}", file=sys.stderr, flush=True)
        rest = run_daemon(bench, seconds, ours)
        if bench.programs.echo is not None:
            run_c(bench, min(seconds, C_MOST_S), theirs)
    yield from ours.rows("daemon")
    yield from theirs.rows("C") if theirs.runs_ns else ()
    yield from rest
    taken = stops_ms(bench, stops) if stops else []
    for what, share in (("p50", 0.5), ("p99", 0.99), ("most", 1.0)) if taken else ():
        value = percentile([round(ms * 1e6) for ms in taken], share) / 1e6
        yield Row(f"a third party's stop, of {stops}, {what}", value, "ms")
    for share, goal_us in OWN_GOAL_US.items():
        yield Row(
            f"goal: own p{share * 100:g} at most {goal_us:g} us",
            *_met(max(ours.own_us(share)), goal_us),
        )
    if taken:
        p99_ms = percentile([round(ms * 1e6) for ms in taken], 0.99) / 1e6
        yield Row(f"goal: stop p99 at most {STOP_GOAL_MS:g} ms", *_met(p99_ms, STOP_GOAL_MS))


def _met(value: float, goal: float) -> tuple[float, str]:
    return value, "met" if value <= goal else "NOT MET"


@click.command()
@click.option("--axes", "counts", multiple=True, type=click.IntRange(1, 6), default=(1, 3, 6))
@click.option("--rate", type=click.Choice(["100", "250"]), default="100", show_default=True)
@click.option("--seconds", type=float, default=20.0, show_default=True)
@click.option("--pairs", type=click.IntRange(1), default=1, show_default=True)
@click.option("--stops", type=click.IntRange(0), default=100, show_default=True)
@click.option("--load", "loaded", is_flag=True, help="On a machine kept busy.")
@click.option("--transport", type=click.Choice(("pty", "socket")), default="pty")
@click.option("--memory", type=click.FloatRange(min=1.0), metavar="MINUTES", help="Only memory.")
@click.option("--no-realtime", is_flag=True, help="The daemon at ordinary priority.")
def main(
    *,
    counts: tuple[int, ...],
    rate: Literal["100", "250"],
    seconds: float,
    pairs: int,
    stops: int,
    loaded: bool,
    memory: float | None,
    no_realtime: bool,
    transport: str,
) -> None:
    """Print the figures of each number of axes."""
    case = Case(
        "daemon", 250 if rate == "250" else 100, loaded, not no_realtime, transport=transport
    )
    with tempfile.TemporaryDirectory(prefix="smad-axes-") as place:
        programs = Programs(Path(place))
        for count in counts if memory is not None else ():
            plain = replace(case, realtime=False)
            with boards(programs, plain, count, "--speed", SPEED, "--paced-by-host") as bench:
                click.echo(f"\n{bench.name}")
                for row in memory_rows(bench, memory or 1.0):
                    click.echo(row)
        for count in counts if memory is None else ():
            with boards(programs, case, count) as bench:
                click.echo(f"\n{bench.name}, {os.cpu_count()} cores, {seconds:g} s")
                for row in measure(bench, seconds, pairs, stops):
                    click.echo(row)


if __name__ == "__main__":
    main()
