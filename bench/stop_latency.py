"""How long a third party's stop takes until the board is not armed, idle and under floods.

python -m bench.stop_latency [--stops 200] [--only NAME] [--transport socket|pty]

A daemon at 100 Hz and a simulated board run in real time. One client arms and drives 0.3 A; another
sends commands of one kind without pause; a third stops. Measured from its call to its reply, which
comes when a sample has shown that the board is not armed.

The board has real-time priority, as a board of its own is not kept waiting by this machine, and so
have those who arm and stop, above all but board and daemon: what is measured is the daemon, not how
busy the machine is. Bytes pass through a socket: on a pseudo-terminal, workers of the kernel hand
them on, and the flood keeps those waiting as well (docs/guide/daemon.md). `--transport pty` shows
by how much.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
import zmq
from msgspec import Struct

from bench.programs import Case, Programs, hurry
from smad.api import Clear, GetMotion, GetStatus
from smad.client import Client, Refused
from smad.client.wire import Conversation, connect, new_identity
from smad.control.commands import DriveCurrent
from smad.view.terminal.tables import print_columns

GOAL_MS = 20.0
IN_FLIGHT = 48
"""Fewer than may wait for the board (MOST_WAITING), so that the owner can arm at all."""

FLOODS: dict[str, Struct | None] = {
    "idle": None,
    "motion": GetMotion(),
    "status": GetStatus(),
    "current": DriveCurrent(i_x_A=0.3),
    "clear": Clear(fault=1),
}
STOPPER_PRIORITY = 70
_PATIENCE_S = 60.0


def flood(name: str, address: str) -> None:
    """Send commands as fast as replies come, some of them always on their way."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    command = FLOODS[name]
    assert command is not None
    socket = connect(zmq.Context(), address, None, new_identity())
    conversation = Conversation()
    for _ in range(IN_FLIGHT):
        socket.send(conversation.request(command)[1])
    while True:
        socket.recv()
        socket.send(conversation.request(command)[1])


@contextlib.contextmanager
def flooded(name: str, address: str) -> Iterator[None]:
    """Have the flood on for as long as the block lasts."""
    if FLOODS[name] is None:
        yield
        return
    words = [sys.executable, "-m", "bench.stop_latency", "--flood", name, address]
    child = subprocess.Popen(words)
    try:
        yield
    finally:
        child.kill()
        child.wait()


@contextlib.contextmanager
def bench_in(folder: Path, transport: str) -> Iterator[None]:
    """A daemon at 100 Hz and a simulated board that no other process keeps waiting."""
    programs, case = Programs(folder), Case("daemon", 100, loaded=False, transport=transport)
    with programs.device(case) as (port, fds):
        daemon = programs.daemon(case, port, fds)
        try:
            daemon.wait_until_ready()
            yield
        finally:
            daemon.end()


def armed_and_driven(client: Client, axes: Sequence[str] = ("",)) -> None:
    """Arm, trying again while the bench cools or is busy, and drive a little: springs stay cold."""
    deadline_s = time.monotonic() + _PATIENCE_S
    while True:
        try:
            # The stops before were asked for here: this client knows of them.
            client.as_of(None)
            client.arm()
            for axis in axes:
                client[axis].current(DriveCurrent(i_x_A=0.3))
        except Refused:
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.02)
        else:
            return


def latencies_ms(folder: Path, name: str, stops: int) -> list[float]:
    """Stop `stops` times under a flood; return how long each took."""
    taken = []
    with (
        Client(folder=folder, timeout_s=_PATIENCE_S) as owner,
        Client(folder=folder, timeout_s=_PATIENCE_S) as third,
        flooded(name, owner.connection.command),
    ):
        for n in range(stops):
            armed_and_driven(owner)
            # Not in step with the board's samples.
            time.sleep(0.02 + 0.01 * (n * 0.618 % 1.0))
            began_s = time.perf_counter()
            motion = third.disarm()
            taken.append((time.perf_counter() - began_s) * 1e3)
            if motion.armed or motion.mode in ("ARMED", "HOLD"):
                raise SystemExit(f"a stop replied while the board was {motion.mode}")
    return sorted(taken)


@click.command()
@click.option("--stops", type=click.IntRange(10), default=200, show_default=True)
@click.option("--only", type=click.Choice(tuple(FLOODS)), multiple=True)
@click.option("--transport", type=click.Choice(("socket", "pty")), default="socket")
@click.option("--flood", "flooding", type=(str, str), hidden=True)
def main(
    stops: int, only: tuple[str, ...], transport: str, flooding: tuple[str, str] | None
) -> None:
    """Print the latencies of a third party's stop."""
    if flooding is not None:
        flood(*flooding)
    rows = []
    hurry(os.getpid(), STOPPER_PRIORITY)
    with tempfile.TemporaryDirectory(prefix="smad-stops-") as name, bench_in(Path(name), transport):
        for kind in only or FLOODS:
            click.echo(f"{kind} …", err=True)
            taken = latencies_ms(Path(name), kind, stops)
            quantiles = [taken[int(share * (len(taken) - 1))] for share in (0.5, 0.99, 1.0)]
            within = "ok" if quantiles[1] <= GOAL_MS else f"above {GOAL_MS:g} ms"
            rows.append((kind, str(stops), *(f"{value:.1f}" for value in quantiles), within))
    header = ("flood of", "stops", "p50 ms", "p99 ms", "max ms", "p99")
    print_columns(header, rows, {1, 2, 3, 4})


if __name__ == "__main__":
    main()
