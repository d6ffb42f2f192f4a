"""How quick the daemon is with several axes: `python -m bench.axes [--rate HZ] [--load] …`.

For each number of axes a daemon and its simulated boards run as processes; all axes follow a
sinusoid. What is printed is of the axis that was slowest: the daemon's share of a sample, missed
samples. Then another client stops the bench again and again: from its call until the reply, which
comes when no board is armed. The load of the machine is printed with it: on one that is busy with
other things these figures say little.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click

from smad.api import AxisStatus, Status
from smad.client import Client
from smad.client.errors import Refused
from smad.config.axes import USUAL_NAMES
from smad.control.commands import Sine
from smad.processes.daemon import running_daemon

_SINE = Sine(amplitude_mm=1.0, period_s=6.0, cycles=1000)
_COOL_S = 60.0


@click.command()
@click.option("--axes", "counts", multiple=True, type=click.IntRange(1, 6), default=(1, 3, 6))
@click.option("--rate", type=click.Choice(["100", "250"]), default="100", show_default=True)
@click.option("--seconds", type=float, default=10.0, show_default=True)
@click.option("--stops", type=int, default=5, show_default=True)
@click.option("--load", is_flag=True, help="Beside two processes that compute without end.")
@click.option("--no-realtime", is_flag=True, help="At ordinary priority.")
def main(
    *, counts: tuple[int, ...], rate: str, seconds: float, stops: int, load: bool, no_realtime: bool
) -> None:
    """Print a row for each number of axes."""
    hogs = [subprocess.Popen([sys.executable, "-c", "while 1: pass"]) for _ in range(2 * load)]
    try:
        for count in counts:
            click.echo(_row(count, rate, seconds, stops, no_realtime=no_realtime))
    finally:
        for hog in hogs:
            hog.kill()


def _row(count: int, rate: str, seconds: float, stops: int, *, no_realtime: bool) -> str:
    arguments = ["--sim", "--rate", rate, *(["--no-realtime"] if no_realtime else [])]
    arguments += ["--axes", str(count)] if count > 1 else []
    with (
        tempfile.TemporaryDirectory() as folder,
        running_daemon(arguments, Path(folder)),
        Client(folder=folder, timeout_s=30.0) as bench,
    ):
        time.sleep(2.0)
        took_ms = [_stop(bench, count, Path(folder)) for _ in range(stops)]
        _arm(bench, count)
        bench.reset_timing()
        before = _parts(bench.status())
        time.sleep(seconds)
        after = _parts(bench.status())
        bench.disarm()
    missed = sum(after[n].counts.missed - before[n].counts.missed for n in after)
    samples = sum(after[n].counts.samples - before[n].counts.samples for n in after)
    shares = [part.timing.own_share for part in after.values()]
    stopped = f"{statistics.median(took_ms):.1f} ms, most {max(took_ms):.1f}" if took_ms else "–"
    return (
        f"{count} axes, {rate} Hz: {samples} samples, {missed} missed; own share "
        f"p50 {max(s.p50_us for s in shares):.0f}, p99 {max(s.p99_us for s in shares):.0f}, "
        f"p99.9 {max(s.p999_us for s in shares):.0f} us; stop p50 {stopped}; "
        f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )


def _parts(status: Status) -> dict[str, Status | AxisStatus]:
    return dict(status.axes) if status.axes else {"": status}


def _arm(bench: Client, count: int) -> None:
    deadline_s = time.monotonic() + _COOL_S
    while True:
        try:
            bench.arm()
            break
        except Refused:
            # The springs may still be cooling from before.
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.5)
    bench.move(_SINE) if count == 1 else bench.move(dict.fromkeys(USUAL_NAMES[:count], _SINE))


def _stop(bench: Client, count: int, folder: Path) -> float:
    """Return how long a stop of another client takes until no board is armed, in ms."""
    _arm(bench, count)
    time.sleep(0.5)
    with Client(folder=folder, timeout_s=30.0) as other:
        other.motion()
        began_s = time.perf_counter()
        motion = other.disarm()
        took_s = time.perf_counter() - began_s
    assert not motion.armed
    bench.as_of(None)
    return took_s * 1e3


if __name__ == "__main__":
    main()
