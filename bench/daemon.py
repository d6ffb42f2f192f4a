"""How quick and steady the daemon is: `python -m bench.daemon [--quick|--steps|--memory MINUTES]`.

Rows are of 30 s each, five of a case, interleaved with those it is compared with; what is printed
is their median and, in brackets, the least and the greatest. `--quick` takes two of 2 s, `--steps`
leaves out everything but the compared rows, `--memory` everything but that much board time (60 is
an hour, in about ten minutes) after which the memory is looked at again.

Every figure stands beside one of a minimal C program that does the same frame exchange on the same
kind of port under the same load, in interleaved runs. A sentinel on each core says how late any
real-time thread wakes on this machine; where it was late by more than 300 us, the machine itself
was away (a virtual one often is), and the steps of that moment are left out. The share left out is
reported. `rows()` returns what is printed.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import click

from bench.programs import ARM_DEADLINE_S, Case, Programs
from smad.api import Status
from smad.client import Client
from smad.client.arming import arm_when_allowed
from smad.control.commands import Sine
from smad.daemon.trace import load

Pairs = list[tuple[int, int]]
Measured = tuple[Pairs, list[Pairs], dict[str, float]]
Files = tuple[list[Path], dict[str, float]]
"""What the sentinels wrote, and figures by name."""

SETTLE_S = 1.0
REFRESH_S = 1.2
LATE_NS = 300_000
MARGIN_NS = 1_000_000
LONG_SINE = Sine(amplitude_mm=2.0, period_s=7.0, cycles=1000)


@dataclass
class Plan:
    """What is measured, how often and for how long."""

    repeats: int = 5
    seconds: float = 30.0
    memory_minutes: float = 2.0
    compared: tuple[Case, ...] = (
        Case("daemon", 500, True),
        Case("C", 500, True),
        Case("daemon", 100, True),
        Case("daemon", 500, True, realtime=False),
    )
    single: tuple[Case, ...] = (
        Case("daemon", 100, False),
        Case("daemon", 250, True),
        Case("daemon", 500, False),
        Case("C", 500, False),
        Case("daemon", 500, True, transport="socket"),
        Case("daemon", 100, True, transport="socket"),
    )


class Row(NamedTuple):
    """One figure: the median of its runs, and the least and greatest of several."""

    name: str
    value: float
    unit: str
    least: float | None = None
    greatest: float | None = None

    def __str__(self) -> str:
        spread = ""
        if self.least is not None and self.greatest is not None:
            spread = f"  ({self.least:.4g} to {self.greatest:.4g})"
        return f"{self.name:<70}{self.value:>12.4g} {self.unit}{spread}"


def row_of(name: str, values: Sequence[float], unit: str) -> Row:
    """Return the median of the runs, with their spread if there are several."""
    if len(values) == 1:
        return Row(name, values[0], unit)
    return Row(name, statistics.median(values), unit, min(values), max(values))


@dataclass
class Result:
    """What the runs of one case gave: the steps and the figures of each."""

    runs_ns: list[list[int]] = field(default_factory=list)
    masked: int = 0
    late_ns: list[int] = field(default_factory=list)
    figures: dict[str, list[float]] = field(default_factory=dict)

    def add(self, steps: Pairs, lateness: list[Pairs], figures: dict[str, float]) -> None:
        """Take in one run: its steps, what each sentinel saw, its figures."""
        answered = unmasked(steps, lateness)
        self.runs_ns.append(answered)
        self.masked += len(steps) - len(answered)
        self.late_ns += [late for pairs in lateness for _, late in pairs]
        for name, value in figures.items():
            self.figures.setdefault(name, []).append(value)

    def rows(self, name: str) -> list[Row]:
        """Return the rows of the case: of each percentile and figure the median of the runs."""
        total = sum(map(len, self.runs_ns)) + self.masked
        rows = [
            row_of(f"{name}: own {label}", self.own_us(share), "us")
            for label, share in (("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999))
        ]
        rows.append(Row(f"{name}: steps left out", 100 * self.masked / max(total, 1), "%"))
        if self.late_ns:
            rows += [
                Row(f"{name}: sentinel late {label}", percentile(self.late_ns, share) / 1e3, "us")
                for label, share in (("p99", 0.99), ("p99.9", 0.999))
            ]
        return rows + [
            row_of(f"{name}: {what}", values, "us" if " p" in what else "")
            for what, values in self.figures.items()
        ]

    def own_us(self, share: float) -> list[float]:
        """Return one percentile of the steps, for each run."""
        return [percentile(run, share) / 1e3 for run in self.runs_ns]


def percentile(values: Sequence[int], share: float) -> float:
    """Return the value below which that share lies; 0 when there are none."""
    ordered = sorted(values)
    return float(ordered[min(int(share * len(ordered)), len(ordered) - 1)]) if ordered else 0.0


def unmasked(steps: Pairs, lateness: list[Pairs]) -> list[int]:
    """Return how long the steps took (ns) that fell where no sentinel was late.

    Only steps between the sentinels' first and last waking count, if there are sentinels.
    """
    if not lateness or not all(lateness):
        return [took for _, took in steps]
    bad = sorted(
        (due - MARGIN_NS, due + late + MARGIN_NS)
        for pairs in lateness
        for due, late in pairs
        if late > LATE_NS
    )
    begin = max(pairs[0][0] for pairs in lateness)
    end = min(pairs[-1][0] for pairs in lateness)
    starts = [first for first, _ in bad]
    # The latest end of all intervals up to each one, as they overlap.
    ends: list[int] = []
    for _, last in bad:
        ends.append(max(last, ends[-1]) if ends else last)
    unmasked_steps = []
    for read, took in steps:
        before = bisect_right(starts, read + took) - 1
        if begin <= read <= end and not (before >= 0 and ends[before] >= read):
            unmasked_steps.append(took)
    return unmasked_steps


def measure(
    programs: Programs, case: Case, seconds: float
) -> tuple[Pairs, list[Pairs], dict[str, float]]:
    """Run one case once; return its steps, the sentinels' lateness, and its figures."""
    files, figures = (_run_c if case.who == "C" else _run_daemon)(programs, case, seconds)
    lateness = [load(file) for file in files]
    steps = load(programs.trace)
    if lateness:
        first, last = lateness[0][0][0], lateness[0][-1][0]
        steps = [pair for pair in steps if first <= pair[0] <= last]
    return steps, lateness, figures


def _run_daemon(
    programs: Programs, case: Case, seconds: float
) -> tuple[list[Path], dict[str, float]]:
    with programs.device(case) as (port, fds):
        daemon = programs.daemon(case, port, fds)
        try:
            daemon.wait_until_ready()
            with Client(folder=programs.folder, timeout_s=60.0) as client:
                arm_when_allowed(client, ARM_DEADLINE_S)
                client.move(LONG_SINE)
                connection = client.connection
                with programs.load(case, connection.command, connection.telemetry):
                    time.sleep(SETTLE_S)
                    client.reset_timing()
                    before = client.status()
                    files = programs.sentinels(seconds)
                    # The percentiles are worked out once a second.
                    time.sleep(REFRESH_S)
                    after = client.status()
                client.disarm()
        finally:
            daemon.end()
    return files, _figures(before, after, seconds + REFRESH_S)


def _run_c(programs: Programs, case: Case, seconds: float) -> Files:
    assert programs.echo is not None
    priority = "80" if case.realtime else "0"
    with (
        programs.device(case) as (port, fds),
        programs.load(case, f"ipc://{programs.folder}/answer", ""),
    ):
        name = f"fd:{fds[0]}" if fds else port
        run = subprocess.Popen(
            [str(programs.echo), name, str(seconds + 2 * SETTLE_S), priority, str(programs.trace)],
            stdout=subprocess.DEVNULL,
            pass_fds=fds,
        )
        time.sleep(SETTLE_S)
        files = programs.sentinels(seconds)
        run.wait()
    return files, {}


def _figures(before: Status, after: Status, seconds: float) -> dict[str, float]:
    age, jitter = after.timing.setpoint_age, after.timing.jitter
    counts, earlier = after.counts, before.counts
    return {
        "setpoint age p50": age.p50_us,
        "setpoint age p99": age.p99_us,
        "setpoint age p99.9": age.p999_us,
        "setpoints refused": counts.setpoints_refused - earlier.setpoints_refused,
        "jitter p99": jitter.p99_us,
        "jitter p99.9": jitter.p999_us,
        "samples": counts.samples - earlier.samples,
        "missed samples": counts.missed - earlier.missed,
        "skipped samples": counts.skipped - earlier.skipped,
        "commands a second": (counts.commands - earlier.commands) / seconds,
    }


def command_rows(programs: Programs, calls: int) -> list[Row]:
    """Round trip of a command, and `smad status` from start to prompt."""
    case = Case("daemon", 100, False)
    with programs.device(case) as (port, fds):
        daemon = programs.daemon(case, port, fds)
        try:
            daemon.wait_until_ready()
            with Client(folder=programs.folder) as client:
                client.motion()
                trips = sorted(_timed(client.motion) for _ in range(calls))
            starts = sorted(_timed(lambda: _status_command(programs.folder)) for _ in range(10))
        finally:
            daemon.end()
    return [
        Row("command round trip p50", trips[calls // 2] * 1e6, "us"),
        Row("command round trip p99", trips[calls * 99 // 100] * 1e6, "us"),
        Row("smad status, start to prompt, median of 10", starts[5] * 1e3, "ms"),
        Row("smad status, start to prompt, slowest of 10", starts[-1] * 1e3, "ms"),
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


def memory_rows(programs: Programs, minutes: float) -> list[Row]:
    """Resident memory of the daemon over so much board time at 500 Hz, faster than real time."""
    case = Case("daemon", 500, False, realtime=False)
    with programs.device(case, "--speed", "6", "--paced-by-host") as (port, fds):
        daemon = programs.daemon(case, port, fds)
        try:
            daemon.wait_until_ready()
            with Client(folder=programs.folder, timeout_s=60.0) as client:
                return memory_over(client, minutes, client.move)
        finally:
            daemon.end()


def memory_over(
    client: Client, minutes: float, move: Callable[[Sine], object], rate_hz: int = 500
) -> list[Row]:
    """Resident memory over so much board time; `move` lets the bench, or all axes, follow."""
    began = time.monotonic()
    stretch_s = min(600.0, minutes * 20.0)
    stretches = round(minutes * 60.0 / stretch_s)
    seen: list[float] = []
    for number in range(stretches):
        arm_when_allowed(client, ARM_DEADLINE_S)
        move(Sine(amplitude_mm=2.0, period_s=stretch_s / 40, cycles=40))
        client.wait_until_done()
        client.disarm()
        seen.append(client.status().memory_MiB)
        _say(f"memory: {number + 1} of {stretches} stretches of {stretch_s:.0f} s of board time")
    counts = [part.counts for part in client.status().parts().values()]
    return [
        Row(f"memory after {stretch_s / 60:g} min of board time at {rate_hz} Hz", seen[0], "MiB"),
        Row(f"memory after {minutes:g} min of board time at {rate_hz} Hz", seen[-1], "MiB"),
        Row("samples in that time", float(sum(c.samples for c in counts)), ""),
        Row("missed samples in that time", float(sum(c.missed for c in counts)), ""),
        Row("faster than real time by", minutes * 60.0 / (time.monotonic() - began), ""),
    ]


def rows(plan: Plan | None = None) -> list[Row]:
    """Measure everything; return (name, value, unit) of each figure."""
    chosen = plan or Plan()
    results: dict[Case, Result] = {}
    with tempfile.TemporaryDirectory(prefix="smad-bench-") as place:
        programs = Programs(Path(place))
        cases = [*chosen.single, *(c for _ in range(chosen.repeats) for c in chosen.compared)]
        for number, case in enumerate(cases):
            if case.who == "C" and programs.echo is None:
                continue
            _say(f"{number + 1} of {len(cases)}: {case.name}")
            results.setdefault(case, Result()).add(*measure(programs, case, chosen.seconds))
        rest = command_rows(programs, 2000) if chosen.single else []
        if chosen.memory_minutes:
            rest += memory_rows(programs, chosen.memory_minutes)
    table = [row for case, result in results.items() for row in result.rows(case.name)]
    return [*table, *_ratios(results, chosen.compared), *rest]


def _ratios(results: dict[Case, Result], compared: Sequence[Case]) -> list[Row]:
    reference = next((c for c in compared if c.who == "C" and c in results), None)
    if reference is None:
        return []
    base = results[reference].own_us(0.999)
    return [
        row_of(
            f"{case.name}: own p99.9 over C's, run by run",
            [
                ours / max(theirs, 1e-3)
                for ours, theirs in zip(results[case].own_us(0.999), base, strict=True)
            ],
            "",
        )
        for case in compared
        if case is not reference and case.rate_hz == reference.rate_hz
    ]


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--quick", is_flag=True, help="Two rows of 2 s each instead of five of 30 s.")
@click.option("--steps", is_flag=True, help="Only the compared rows.")
@click.option("--memory", type=click.FloatRange(min=1.0), metavar="MINUTES", help="Only memory.")
def main(quick: bool, steps: bool, memory: float | None) -> None:
    """Print how quick and steady the daemon is."""
    plan = Plan(repeats=2, seconds=2.0, memory_minutes=1.0) if quick else Plan()
    if steps:
        plan = replace(plan, single=(), memory_minutes=0.0)
    if memory is not None:
        plan = replace(plan, repeats=0, single=(), memory_minutes=memory)
    for row in rows(plan):
        print(row)


if __name__ == "__main__":
    main()
