"""Kills in a night: `python -m tests.smad.queue.kills --trials 200 --seed 1`.

Each trial begins a queue of three items on a simulated bench, kills a part of it at a random
instant (runner, item, daemon, simulator, or all four as a power loss does), starts everything
anew, and asks: did anything run twice or get lost, was the bench off, who was told, and when.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import psutil

from campaign.night.run import faults_of_logs
from smad.client import Client
from smad.client.endpoints import FOLDER_VARIABLE, read_connection
from smad.errors import SmadError
from smad.queue.lease import RunnerLease
from smad.queue.queue import Queue
from smad.queue.states import Budget, Item, State

VICTIMS = ("runner", "item", "daemon", "simulator", "everything")
LATEST_S = 14.0
"""Kills fall within so long after the first item began."""
MESSAGE_S, RELAY_S, HEAT_S = 5.0, 2.0, 5.0
_PATIENCE_S = 600.0
_LOGS_CLOSED_S = 60.0
_MOVES = """
[[pieces]]
kind = "step"
displacement_mm = 3.0
duration_s = 6.0
"""
_NOTE = "import sys, time; open({path!r}, 'a').write(f'{{time.time():.3f}} ' + sys.stdin.read())"
_HOLDER = (
    "import signal, sys, time\n"
    "def fall(*_):\n"
    "    open({path!r}, 'a').write(f'{{time.time():.3f}}\\n'); sys.exit()\n"
    "signal.signal(signal.SIGTERM, fall)\n"
    "signal.pause()"
)


@dataclass
class Outcome:
    """What one trial showed; times are seconds after the kill, None where nothing came."""

    seed: int
    victim: str
    delay_s: float
    states: list[str]
    faults: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    off_s: float | None = None
    message_s: float | None = None
    relay_s: float | None = None
    stall_s: float = 0.0
    """The longest that this computer kept us from running meanwhile."""


class Rig:
    """Bench, daemon, hooks and relay in one folder; what was killed is started anew."""

    def __init__(self, folder: Path, speed: float) -> None:
        self.folder = folder
        self.logs = folder / "runs"
        self.told = folder / "told.txt"
        self.cut = folder / "cut.txt"
        runtime = folder / "run"
        runtime.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.environ[FOLDER_VARIABLE] = str(runtime)
        self._connection = runtime / "bench.json"
        self._speed = speed
        self._parts: dict[str, subprocess.Popen[bytes]] = {}
        note = [sys.executable, "-c", _NOTE.format(path=str(self.told))]
        hooks = ("on_link_lost", "on_queue_end", "on_fault", "on_stop")
        lines = [f"{name} = {json.dumps(note)}" for name in hooks]
        (folder / "config.toml").write_text(
            f"[recorder]\nfolder = {json.dumps(str(self.logs))}\n[hooks]\n" + "\n".join(lines)
        )
        (folder / "moves.toml").write_text(_MOVES)

    def start(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        """Start a command of smad, unless it runs."""
        running = self._parts.get(name)
        if running is not None and running.poll() is None:
            return running
        with (self.folder / f"{name}.log").open("ab") as log:
            self._parts[name] = subprocess.Popen(
                [sys.executable, "-m", "smad", *words],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=self.folder,
                start_new_session=True,
            )
        return self._parts[name]

    def ready(self) -> None:
        """Have daemon, hooks and relay running, on a bench that is cold and in order."""

        def in_order() -> bool:
            # Started anew when it found its pseudo-terminal taken by a daemon of somebody else.
            self.start(
                "daemon",
                "start",
                "--sim",
                "--paced-by-host",
                "--speed",
                str(self._speed),
                "--config",
                str(self.folder / "config.toml"),
            )
            return self.in_order()

        until(in_order, "the bench is not in order")
        holder = [sys.executable, "-c", _HOLDER.format(path=str(self.cut))]
        before = text_of(self.folder / "relay.log").count("supply is on")
        running = self._parts.get("relay")
        if running is None or running.poll() is not None:
            self.start("relay", "hooks", "relay", "--while", *holder)
            until(
                lambda: text_of(self.folder / "relay.log").count("supply is on") > before,
                "the relay does not close",
            )
        self.start("hooks", "hooks", "run")

    def in_order(self) -> bool:
        """Whether the bench is SAFE; clears a fault."""
        if read_connection(self._connection) is None:
            return False
        try:
            with Client(timeout_s=2.0) as client:
                motion = client.motion()
                if motion.fault is not None:
                    client.clear()
                return motion.mode == "SAFE" and client.status().board is not None
        except SmadError:
            return False

    def process_of(self, victim: str, runner: subprocess.Popen[bytes]) -> list[psutil.Process]:
        """Return the processes of a part."""
        daemon = psutil.Process(self._parts["daemon"].pid)
        found = {
            "runner": [psutil.Process(runner.pid)],
            "item": psutil.Process(runner.pid).children(),
            "daemon": [daemon],
            "simulator": daemon.children(),
        }
        if victim == "everything":
            return [process for part in found.values() for process in part]
        return found[victim]

    def relay_is_closed(self) -> bool:
        """Whether the supply is on: it falls for good when samples stay away for long enough."""
        return self._parts["relay"].poll() is None

    def end(self, name: str) -> None:
        """End a part, killed if it does not end."""
        process = self._parts[name]
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(30.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def close(self) -> None:
        """End everything."""
        for name in self._parts:
            self.end(name)


def until(over: Callable[[], bool], otherwise: str, patience_s: float = _PATIENCE_S) -> float:
    """Wait until `over`; return how long that took. Raises RuntimeError."""
    began_s = time.monotonic()
    while not over():
        if time.monotonic() - began_s > patience_s:
            raise RuntimeError(otherwise)
        time.sleep(0.05)
    return time.monotonic() - began_s


def drawn(seed: int) -> tuple[str, float]:
    """Return whom a seed kills, and how long after the first item began."""
    draw = random.Random(seed)
    return draw.choice(VICTIMS), draw.uniform(0.0, LATEST_S)


def trial(rig: Rig, seed: int) -> Outcome:
    """Carry one kill out. The seed decides who is killed, and when."""
    victim, delay_s = drawn(seed)
    rig.ready()
    folder = rig.folder / f"queue-{seed}"
    words = ("run", "moves", str(rig.folder / "moves.toml"))
    with Queue(folder) as queue:
        item = Item(id=0, position=0.0, kind="move", title="move", words=words, folder=str(folder))
        queue.add_checked([item] * 3)
        rig.start("hooks", "hooks", "run")
        first = runner_of(rig, folder, "first")
        until(lambda: RunnerLease(folder).runs(), "no runner")
        until(lambda: "runner of" in text_of(folder / "first.log"), "the runner does not begin")
        watcher = rig.start(f"hooks-{seed}", "hooks", "run", "--folder", str(folder))
        until(lambda: "watching" in text_of(rig.folder / f"hooks-{seed}.log"), "no hooks")
        queue.confirm(queue.propose(time.time() + 3600.0, Budget()).code)
        until(lambda: queue.snapshot().items[0].state is not State.QUEUED, "nothing begins")
        time.sleep(delay_s)
        active = queue.snapshot().mode == "running"
        closed = rig.relay_is_closed()
        # Before the first one is stopped: a busy computer may take a second to stop them all.
        killed_unix_s = time.time()
        for process in rig.process_of(victim, first):
            process.suspend()
        for process in rig.process_of(victim, first):
            process.kill()
        outcome = Outcome(seed, victim, round(delay_s, 2), [])
        if not closed:
            outcome.relay_s = 0.0
        _await_consequences(rig, outcome, killed_unix_s, active=active)
        first.terminate()
        first.wait(60.0)
        if victim == "simulator":
            # The daemon waits for its port, which a new one makes.
            rig.end("daemon")
        rig.ready()
        second = runner_of(rig, folder, "second")
        until(lambda: "runner of" in text_of(folder / "second.log"), "the second does not begin")
        time.sleep(1.5)
        # It closes the logs of the first one beside its turns.
        with contextlib.suppress(RuntimeError):
            until(lambda: not faults_of_logs(rig.logs), "a log is not closed", _LOGS_CLOSED_S)
        _check_queue(queue, folder, outcome)
        second.terminate()
        second.wait(60.0)
        watcher.terminate()
        watcher.wait(30.0)
    outcome.faults += faults_of_logs(rig.logs)
    return outcome


def runner_of(rig: Rig, folder: Path, name: str) -> subprocess.Popen[bytes]:
    """Start a runner of the queue."""
    with (folder / f"{name}.log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "smad", "queue", "run", "--folder", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )


def text_of(path: Path) -> str:
    """Return what a file holds; nothing when it is not there."""
    return path.read_text(errors="replace") if path.exists() else ""


def _await_consequences(rig: Rig, outcome: Outcome, killed_unix_s: float, *, active: bool) -> None:
    """Note when the bench was off, the message came and the relay fell."""
    bench_gone = outcome.victim in ("daemon", "simulator", "everything")
    deadline_s = time.monotonic() + 12.0
    looked_s = time.monotonic()
    while time.monotonic() < deadline_s:
        stalled_s = round(time.monotonic() - looked_s - 0.05, 2)
        looked_s = time.monotonic()
        outcome.stall_s = max(outcome.stall_s, stalled_s)
        now_s = time.time() - killed_unix_s
        # With daemon or simulator the simulated board is gone: nothing is left to be off or on.
        if outcome.off_s is None and not bench_gone and is_off():
            outcome.off_s = round(now_s, 2)
        outcome.message_s = _first_after(rig.told, killed_unix_s)
        if outcome.relay_s is None:
            outcome.relay_s = _first_after(rig.cut, killed_unix_s)
        told = outcome.message_s is not None or not active
        if told and (outcome.relay_s if bench_gone else outcome.off_s) is not None:
            break
        time.sleep(0.05)
    for name, seen_s, limit_s, asked in (
        ("heat", outcome.off_s, HEAT_S, not bench_gone),
        ("message", outcome.message_s, MESSAGE_S, active),
        ("relay", outcome.relay_s, RELAY_S, bench_gone),
    ):
        if asked and (seen_s is None or seen_s > limit_s):
            outcome.late.append(f"{name} after {seen_s} s, limit {limit_s:g} s")


def is_off() -> bool:
    """Whether the daemon says that the board is not armed; what it does not say is not known."""
    with contextlib.suppress(SmadError), Client(timeout_s=1.0) as client:
        return not client.motion().armed
    return False


def _first_after(path: Path, unix_s: float) -> float | None:
    times = [float(line.split()[0]) for line in text_of(path).splitlines()]
    return next((round(t - unix_s, 2) for t in times if t >= unix_s), None)


def _check_queue(queue: Queue, folder: Path, outcome: Outcome) -> None:
    snapshot = queue.snapshot()
    outcome.states = [item.state.value for item in snapshot.items]
    if len(snapshot.items) != 3:
        outcome.faults.append(f"{3 - len(snapshot.items)} items lost")
    begun = text_of(folder / "first.log") + text_of(folder / "second.log")
    for item in snapshot.items:
        count = begun.count(f"item {item.id} begins")
        if count > 1:
            outcome.faults.append(f"item {item.id} ran {count} times")
    if " begins" in text_of(folder / "second.log"):
        outcome.faults.append("something began without a person")
    if snapshot.mode != "paused" or snapshot.running is not None:
        outcome.faults.append(f"the queue is {snapshot.mode}")


def table(outcomes: list[Outcome]) -> str:
    """Return the outcomes by victim as a Markdown table."""
    lines = [
        "| killed | trials | run twice, lost or begun alone | most s until off | most s until told "
        "| most s until the relay fell | failures |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for victim in VICTIMS:
        found = [o for o in outcomes if o.victim == victim]
        bad = sum("ran" in f or "lost" in f or "began" in f for o in found for f in o.faults)
        most = [
            max((getattr(o, name) for o in found if getattr(o, name) is not None), default=None)
            for name in ("off_s", "message_s", "relay_s")
        ]
        shown = " | ".join("–" if value is None else f"{value:.1f}" for value in most)
        failures = sum(bool(o.faults or o.late) for o in found)
        lines.append(f"| {victim} | {len(found)} | {bad} | {shown} | {failures} |")
    return "\n".join(lines)


def main() -> int:
    """Run the trials; print a line for each, and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", type=float, default=4.0)
    parser.add_argument("--folder", type=Path, required=True, help="An empty folder.")
    options = parser.parse_args()
    outcomes: list[Outcome] = []
    rig = Rig(options.folder, options.speed)
    try:
        for number in range(options.trials):
            outcomes.append(trial(rig, options.seed + number))
            print(json.dumps(asdict(outcomes[-1])), flush=True)
    finally:
        rig.close()
    print(table(outcomes))
    return int(any(outcome.faults or outcome.late for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
