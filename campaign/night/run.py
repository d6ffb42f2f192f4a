"""The night on real processes: daemon, runner, items, hooks; only the bench is simulated.

The bench waits for its host, in whose process it is, so board time passes as fast as the daemon
answers, at most `speed` times the wall clock. Times that people feel, such as until a word is
there, are of the wall clock.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import psutil

from campaign.night.daemon import FIFO
from campaign.night.draws import ENDS_NOTHING, Trouble, troubles
from campaign.night.report import MESSAGE_S, Look, Met, NightResult, late, rerun, unmet
from campaign.rig import BAUD, DaemonRig, rig_config, start_daemon
from smad.client import Client
from smad.client.endpoints import FOLDER_VARIABLE
from smad.config import HooksConfig, LinkConfig, RecorderConfig
from smad.errors import SmadError
from smad.experiments.endurance.run import earlier_cycles
from smad.processes.daemon import DaemonProcess
from smad.progress import Say
from smad.queue.queue import Queue
from smad.queue.states import Budget, State
from smad.runlog.open_logs import being_written
from smad.runlog.reader import read_run
from smad.runlog.recover import recovered_path

RATE_HZ: Literal[100] = 100
LOOK_EVERY_S = 30.0
"""Board time between two looks at memory and disk."""
PERSON_AFTER_S = 60.0
"""Board time from a pause until a person is there."""
MOVES_A_TURN = 3
CYCLES_A_TURN = 100
TURN_S = 1100.0
"""About what a turn of the items takes: three short moves, a hundred cycles of endurance."""
HOT_S = 10.0
"""Longer than an armed bench without an item may last, by the wall clock."""
_MOVES = """
[[pieces]]
kind = "sine"
amplitude_mm = 4.0
period_s = 8.0
cycles = 3
"""
_NOTE = "import sys, time; open({path!r}, 'a').write(f'{{time.time():.3f}} ' + sys.stdin.read())"
_POLL_S = 0.1
_AWAY_S = 3.0
_PATIENCE_S = 240.0


class NightRig(DaemonRig):
    """The processes of the night in `folder`; what was killed is started anew by `mend`."""

    def __init__(self, folder: Path, seed: int, speed: float) -> None:
        self.words = folder / "words.txt"
        self.logs = folder / "runs"
        note = (sys.executable, "-c", _NOTE.format(path=str(self.words)))
        self._config = rig_config(
            folder,
            "the board in the daemon's process",
            link=LinkConfig(baud=BAUD, rate_hz=RATE_HZ, reconnect_interval_s=0.05),
            # A minute of board time, as on a bench; the box goes by the wall clock.
            recorder=RecorderConfig(folder=str(self.logs), black_box_s=60.0 / speed),
            hooks=HooksConfig(on_fault=note, on_stop=note, on_link_lost=note, on_queue_end=note),
        )
        self._seed = seed
        self._speed = speed
        super().__init__(folder, self._started_daemon(folder))
        self.children: dict[str, subprocess.Popen[bytes]] = {}

    def _started_daemon(self, folder: Path) -> DaemonProcess:
        self._seed += 1
        words = ["--seed", str(self._seed), "--speed", str(self._speed)]
        return start_daemon(folder, self._config, words, program=("-m", "campaign.night.daemon"))

    def inject(self, text: str) -> None:
        """Break something of the bench with the next sample."""
        fifo = os.open(self.folder / FIFO, os.O_WRONLY | os.O_NONBLOCK)
        with open(fifo, "w", encoding="utf-8") as file:
            print(text, file=file)

    def mend(self) -> None:
        """Have daemon, hooks and runner running."""
        if self.daemon.process.poll() is not None:
            self.daemon = self._started_daemon(self.folder)
        self.daemon.wait_until_ready()
        for name, words in (
            ("hooks", ["hooks", "run"]),
            ("runner", ["queue", "run", "--folder", str(self.logs)]),
        ):
            child = self.children.get(name)
            if child is None or child.poll() is not None:
                with (self.folder / f"{name}.log").open("ab") as log:
                    self.children[name] = subprocess.Popen(
                        [sys.executable, "-m", "smad", *words],
                        stdin=subprocess.DEVNULL,
                        stdout=log,
                        stderr=log,
                        cwd=self.folder,
                        start_new_session=True,
                    )

    def kill(self, *names: str) -> None:
        """Kill parts at once: daemon, runner, hooks, item."""
        processes = [process for name in names for process in self._processes(name)]
        for process in processes:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.suspend()
        for process in processes:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        for child in (self.daemon.process, *self.children.values()):
            if child.pid in {process.pid for process in processes}:
                child.wait()

    def _processes(self, name: str) -> list[psutil.Process]:
        with contextlib.suppress(psutil.NoSuchProcess):
            if name == "daemon":
                return [psutil.Process(self.daemon.process.pid)]
            if name == "item":
                children: list[psutil.Process] = psutil.Process(
                    self.children["runner"].pid
                ).children()
                return children
            return [psutil.Process(self.children[name].pid)]
        return []

    def close(self) -> None:
        """End everything."""
        for child in self.children.values():
            child.send_signal(signal.SIGTERM)
            try:
                child.wait(60.0)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        super().close()


class Night:
    """One night, look by look."""

    def __init__(self, rig: NightRig, queue: Queue, *, asked: NightOptions, say: Say) -> None:
        self.result = NightResult(asked.seed)
        self._rig = rig
        self._queue = queue
        self._seconds = asked.hours * 3600.0
        self._longest_s = asked.longest_h * 3600.0
        self._say = say
        self._due = troubles(asked.seed, self._seconds, asked.troubles)
        self._board_s = 0.0
        self._samples = 0
        self._looked_s = 0.0
        self._paused_s: float | None = None
        self._hot_since_s: float | None = None
        self._client: Client | None = None

    def run(self) -> NightResult:
        """Carry the night out, until its time is over and the last item has ended."""
        began_s = time.monotonic()
        end_s = began_s + self._longest_s
        self._rig.mend()
        self._fill()
        self._visit()
        while self._board_s < self._seconds and time.monotonic() < end_s and self._waits():
            self._pass_time()
            if self._due and self._board_s >= self._due[0].at_s and self._works():
                self._meet(self._due.pop(0))
            self._let_person_come()
            time.sleep(_POLL_S)
        if time.monotonic() < end_s:
            self.result.failures += unmet(self._board_s, self._seconds, self._due)
        self._note_paused()
        self._queue.pause(now=True)
        self._until(lambda: self._queue.snapshot().running is None, "the last item ends")
        self.result.board_h = self._board_s / 3600.0
        self.result.wall_h = (time.monotonic() - began_s) / 3600.0
        self._judge()
        return self.result

    def _fill(self) -> None:
        """Queue as much as the night can take."""
        moves = self._rig.folder / "moves.toml"
        moves.write_text(_MOVES)
        cycles = f"--cycles {CYCLES_A_TURN} --displacement -4 4 --dwell 0.5 --full-every 10"
        turn = (
            *self._queue.add("move", str(moves), repeat=MOVES_A_TURN),
            *self._queue.add(
                "run", "endurance", *cycles.split(), "--folder", str(self._rig.logs), "--go-on"
            ),
        )
        # More than it can take: items that are interrupted are shorter.
        self._queue.add_checked(turn * int(2.0 * self._seconds / TURN_S))

    def _waits(self) -> bool:
        snapshot = self._queue.snapshot()
        return bool(snapshot.queued or snapshot.running)

    def _works(self) -> bool:
        """Whether an item runs under an armed queue: a trouble of an idle bench shows little."""
        snapshot = self._queue.snapshot()
        return snapshot.mode == "running" and snapshot.running is not None

    def _connected(self) -> Client:
        if self._client is None:
            self._client = Client(folder=self._rig.folder, timeout_s=5.0, lease_s=None)
        return self._client

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client = None

    def _pass_time(self) -> None:
        """Count board time; see that nothing is armed without an item; look now and then."""
        try:
            status = self._connected().status()
        except SmadError:
            self._drop()
            return
        samples = status.counts.samples
        self._board_s += (
            samples - self._samples if samples >= self._samples else samples
        ) / RATE_HZ
        self._samples = samples
        snapshot = self._queue.snapshot()
        now_s = time.monotonic()
        if status.motion.armed and snapshot.running is None and snapshot.mode == "paused":
            self._hot_since_s = self._hot_since_s or now_s
            if now_s - self._hot_since_s > HOT_S:
                self.result.failures.append(f"armed without an item at {self._board_s:.0f} s")
                self._hot_since_s = now_s
        else:
            self._hot_since_s = None
        if self._board_s - self._looked_s >= LOOK_EVERY_S:
            self._looked_s = self._board_s
            self._look()

    def _look(self) -> None:
        rig, at_h = self._rig, self._board_s / 3600.0
        processes = {"daemon": rig.daemon.process, **rig.children}
        for name, process in processes.items():
            with contextlib.suppress(psutil.NoSuchProcess):
                rss = psutil.Process(process.pid).memory_info().rss
                self._note(f"memory of the {name}", at_h, process.pid, rss)
        logs = sum(_size(path) for path in rig.logs.glob("*.mcap"))
        self._note("run logs", at_h, 0, logs)
        self._note("the queue's file", at_h, 0, _size(self._queue.store.path))
        ended = self._queue.snapshot().items
        done = sum(item.ended_unix_s is not None for item in ended)
        self._say(f"{self._board_s:.0f} of {self._seconds:.0f} s, {done} of {len(ended)} items")

    def _note(self, name: str, at_h: float, process: int, size: float) -> None:
        self.result.looks.setdefault(name, []).append(Look(at_h, process, size / 1e6))

    def _meet(self, trouble: Trouble) -> None:
        """Let a trouble come, and wait for its word and for what the queue makes of it."""
        running = self._queue.snapshot().running
        if running is None:
            return
        met = Met(self._board_s, trouble.kind, running.id, running.words[1])
        self.result.met.append(met)
        met_unix_s = time.time()
        self._bring(trouble.kind)
        deadline_s = time.monotonic() + MESSAGE_S + 1.0
        while time.monotonic() < deadline_s and met.after_s is None:
            met.after_s, met.word = self._word_since(met_unix_s)
            time.sleep(_POLL_S)
        time.sleep(_AWAY_S)
        if trouble.kind == "estop":
            self._rig.inject("power_cycle@0")
        self._rig.mend()
        self._until(self._answers, "the daemon answers")
        runner = self._rig.children["runner"]
        self._until(lambda: self._queue.has_runner and runner.poll() is None, "a runner is there")

    def _bring(self, kind: str) -> None:
        rig = self._rig
        match kind:
            case "unplug":
                rig.inject("unplug@0:seconds=5")
            case "reboot":
                rig.inject("reboot@0")
            case "stop" | "estop":
                with contextlib.suppress(SmadError), Client(folder=rig.folder) as other:
                    other.disarm() if kind == "stop" else other.estop()
            case "power loss":
                rig.kill("daemon", "runner", "item")
            case _:
                rig.kill(kind.removeprefix("kill "))

    def _word_since(self, unix_s: float) -> tuple[float | None, str]:
        for line in _lines(self._rig.words):
            time_text, _, event = line.partition(" ")
            with contextlib.suppress(ValueError):
                if float(time_text) >= unix_s:
                    return round(float(time_text) - unix_s, 2), json.loads(event)["text"]
        return None, ""

    def _answers(self) -> bool:
        try:
            return self._connected().status().board is not None
        except SmadError:
            self._drop()
            return False

    def _let_person_come(self) -> None:
        if self._queue.snapshot().mode == "running":
            self._paused_s = None
        elif self._paused_s is None:
            self._paused_s = self._board_s
        elif self._board_s - self._paused_s >= PERSON_AFTER_S:
            self._visit()
            self._paused_s = None

    def _visit(self) -> None:
        """A person clears what stands and arms the queue in its two steps."""

        def armed() -> bool:
            snapshot = self._queue.snapshot()
            if snapshot.mode == "running" or not snapshot.queued:
                return True
            with contextlib.suppress(SmadError):
                motion = self._connected().motion()
                if motion.fault is not None:
                    self._connected().clear()
                if motion.mode == "SAFE" and snapshot.running is None:
                    proposal = self._queue.propose(time.time() + 12 * 3600.0, Budget())
                    self._queue.confirm(proposal.code)
                    self.result.visits += 1
                    return True
            return False

        self._until(armed, "the queue can be armed")

    def _until(self, done: Callable[[], bool], what: str) -> None:
        def pause() -> None:
            self._pass_time()
            time.sleep(_POLL_S)

        self._rig.wait(what, done, _PATIENCE_S, pause)

    def _note_paused(self) -> None:
        """Note which troubles ended their item: before the night's end interrupts the last one.

        Of several that met one item, the first did.
        """
        snapshot, ended = self._queue.snapshot(), set[int]()
        for met in self.result.met:
            if met.kind == ENDS_NOTHING:
                continue
            interrupted = snapshot.item(met.item).state in (State.INTERRUPTED, State.FAILED)
            met.paused = interrupted and met.item not in ended
            ended.add(met.item)

    def _judge(self) -> None:
        night, rig = self.result, self._rig
        snapshot = self._queue.snapshot()
        items = snapshot.items
        night.states.update(item.state.value for item in items)
        night.messages = len(_lines(rig.words))
        begun = "\n".join(_lines(rig.folder / "runner.log"))
        for number, times in rerun(begun, [item.id for item in items]).items():
            night.failures.append(f"item {number} ran {times} times")
        night.failures += late(night)
        night.cycles = earlier_cycles(rig.logs)
        night.failures += faults_of_logs(rig.logs)


def faults_of_logs(folder: Path) -> list[str]:
    """Return what is wrong with the run logs of a folder; recovered ones are not looked into."""
    faults = []
    for path in sorted(folder.glob("*.mcap")):
        if ".recovered" in path.suffixes or recovered_path(path).exists():
            continue
        try:
            if being_written(path):
                faults.append(f"{path.name} is still written")
            elif (run := read_run(path)).cut_short and len(run):
                faults.append(f"{path.name} was cut and not recovered")
        except SmadError as error:
            faults.append(f"{path.name}: {error}")
    return faults


@dataclass(frozen=True, kw_only=True)
class NightOptions:
    """Hours of board time, seed, bounds: board over wall time, and hours of the wall clock."""

    hours: float
    seed: int
    speed: float
    troubles: int
    longest_h: float


def run_night(folder: Path, asked: NightOptions, say: Say) -> NightResult:
    """Run one night in an empty folder, and leave its queue, run logs and words there.

    Raises SmadError when its processes do not come up, or something is waited for in vain.
    """
    folder.mkdir(parents=True, exist_ok=True)
    before = os.environ.get(FOLDER_VARIABLE)
    os.environ[FOLDER_VARIABLE] = str(folder)
    rig = NightRig(folder, asked.seed, asked.speed)
    try:
        rig.daemon.wait_until_ready()
        with Queue(rig.logs) as queue:
            return Night(rig, queue, asked=asked, say=say).run()
    finally:
        rig.close()
        if before is None:
            del os.environ[FOLDER_VARIABLE]
        else:
            os.environ[FOLDER_VARIABLE] = before


def _lines(path: Path) -> list[str]:
    return path.read_text(errors="replace").splitlines() if path.exists() else []


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
