"""The one process that carries a queue out: looks, lets the machine decide, writes, then acts."""

import contextlib
import functools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from smad.errors import RunLogError, SmadError
from smad.progress import Say, silent
from smad.queue import machine
from smad.queue.bench import BenchSnapshot, BenchWatch
from smad.queue.errors import QueueError, StoreError
from smad.queue.lease import RunnerLease
from smad.queue.machine import Change, EndItem, Obstacle, PostMessage, StartItem
from smad.queue.process import ItemProcess, begin_item
from smad.queue.queue import Queue
from smad.queue.states import Item, Snapshot, State, Usage
from smad.queue.store import Store
from smad.queue.words import clock, state_in_words
from smad.runlog.open_logs import being_written
from smad.runlog.paths import SUFFIX
from smad.runlog.recover import recover, recovered_path

POLL_S = 0.2
USAGE_EVERY_S = 5.0
"""How often what was used is written while an item runs."""
KILL_AFTER_S = 30.0
"""An item that was asked to end, and does not, is killed after so long."""
SAVE_WITHIN_S = 30.0
"""How long it is tried to close or recover a run log."""
_BEFORE_S = 5.0
"""Clocks of files may lag behind ours."""


@dataclass(frozen=True, kw_only=True)
class RunnerParts:
    """What the runner acts with.

    `start` begins an item, which knows of the stops up to a generation. `check` returns why an item
    cannot begin now; None: it can.
    """

    watch: BenchWatch
    start: Callable[[Item, int | None], ItemProcess]
    check: Callable[[Item], Obstacle | None]
    say: Say = silent
    wall_s: Callable[[], float] = time.time
    clock_s: Callable[[], float] = time.monotonic


class Runner:
    """Carries the items of a store out, one at a time. `tick` does what there is to do now."""

    def __init__(self, store: Store, parts: RunnerParts) -> None:
        self._store = store
        self._parts = parts
        self._process: ItemProcess | None = None
        self._item = 0
        self._not_begun = ""
        """Why the item that is written as running has no process, until its end is written."""
        self._asked_to_end_s: float | None = None
        self._generation: int | None = None
        """Stops of the bench that are known: of an arming, or of an item's own."""
        self._armed = False
        self._looked_s: float | None = None
        self._usage = Usage()
        self._written_s = 0.0
        self._complaint = ""
        self._folder = ""
        """Where the daemon recorded when it last answered."""
        self._unsaved: dict[Path, float] = {}
        """Logs of interrupted items that could not be saved yet, and until when that is tried."""

    def begin(self) -> None:
        """Note what an earlier runner left: interrupted items, their logs, a paused queue.

        Raises StoreError.
        """
        interrupted = self._store.snapshot().running
        change = self._store.change(lambda s: machine.recover(s, self._parts.wall_s()))
        self._act(change)
        if interrupted is not None:
            self._save_logs(interrupted)

    def run(self, *, until_paused: bool) -> None:
        """Carry the queue out, for ever or until it pauses with nothing running.

        Raises StoreError when somebody moved its file away: a new queue needs a new runner.
        """
        while True:
            if not self._store.in_place:
                raise StoreError(
                    f"the queue {self._store.path} was moved away or removed",
                    action="start smad queue run again",
                )
            self.tick()
            snapshot = self._store.snapshot()
            if until_paused and snapshot.mode == "paused" and snapshot.running is None:
                return
            time.sleep(POLL_S)

    def tick(self) -> None:
        """Look, decide, write, act. A store that cannot be written holds everything up."""
        try:
            self._tick()
            self._complaint = ""
        except StoreError as error:
            if str(error) != self._complaint:
                self._parts.say(str(error))
            self._complaint = str(error)
            if self._process is not None and not self._may_go_on():
                self._end_process()

    def close(self, reason: str = "the runner was ended") -> None:
        """End the item that runs, in order, and pause. The store may be unwritable by now."""
        with contextlib.suppress(StoreError):
            if self._store.snapshot().mode == "running" or self._process is not None:
                self._act(self._store.change(lambda s: machine.paused(s, reason, end_item=True)))
        deadline_s = self._parts.clock_s() + KILL_AFTER_S + POLL_S
        while (process := self._process) is not None and self._parts.clock_s() < deadline_s:
            self._end_process()
            self.tick()
            if not self._store.in_place and process.poll() is not None:
                # How it ended can be written nowhere.
                return
            time.sleep(POLL_S)

    def _tick(self) -> None:
        view = self._parts.watch.look()
        self._folder = view.folder or self._folder
        self._save_again(view)
        self._meter()
        if self._process is not None:
            self._note_log(view)
            status = self._process.poll()
            if status is not None:
                self._ended(status)
        elif self._not_begun:
            self._end_not_begun()
        snapshot = self._store.snapshot()
        if snapshot.mode == "running":
            snapshot = self._armed_tick(snapshot, view)
        else:
            self._armed = False
        obstacles = self._obstacles(snapshot)
        bench = view.bench
        if machine.candidate(snapshot) is not None:
            bench = self._parts.watch.look(now=True).bench
        self._act(
            self._store.change(
                lambda s: machine.step(s, self._parts.wall_s(), bench, obstacles=obstacles)
            )
        )

    def _armed_tick(self, snapshot: Snapshot, view: BenchSnapshot) -> Snapshot:
        """Pause when a stop came that neither the arming nor an item of ours knows of."""
        assert snapshot.arming is not None
        if not self._armed:
            self._armed, self._generation = True, snapshot.arming.generation
            self._usage, self._written_s = Usage(), self._parts.clock_s()
        if self._process is None:
            view = self._parts.watch.look(now=True)
            if view.generation != self._generation and view.generation is not None:
                change = self._store.change(
                    lambda s: machine.paused(s, "somebody stopped the bench, or started its daemon")
                )
                self._act(change)
                return change.after
        return snapshot

    def _obstacles(self, snapshot: Snapshot) -> Mapping[int, Obstacle]:
        item = machine.candidate(snapshot)
        if item is None or snapshot.arming is None or item.id not in snapshot.arming.items:
            return {}
        obstacle = self._parts.check(item)
        return {} if obstacle is None else {item.id: obstacle}

    def _meter(self) -> None:
        now_s = self._parts.clock_s()
        passed_s = 0.0 if self._looked_s is None else now_s - self._looked_s
        self._looked_s = now_s
        spent = self._parts.watch.usage()
        if not self._armed:
            return
        self._usage = self._usage + spent + Usage(seconds=passed_s)
        if now_s - self._written_s >= USAGE_EVERY_S:
            self._store.change(lambda s: machine.used(s, self._usage))
            self._usage, self._written_s = Usage(), now_s

    def _ended(self, status: int) -> None:
        assert self._process is not None
        last_line = self._process.last_line() if status else ""
        item = self._store.snapshot().item(self._item)
        change = self._store.change(
            lambda s: machine.ended(s, item.id, status, self._parts.wall_s(), said=last_line)
        )
        # Written: from here on the process is forgotten.
        self._generation = self._process.known_stops()
        self._process, self._asked_to_end_s = None, None
        if change.after.item(item.id).state is State.INTERRUPTED:
            self._save_logs(item)
        self._act(change)

    def _act(self, change: Change) -> None:
        for action in change.actions:
            match action:
                case StartItem(item):
                    self._start(item)
                case EndItem():
                    self._end_process()
                case PostMessage(event, text, item):
                    self._parts.say(text)
                    self._store.add_message(
                        event, text, None if item is None else item.id, self._parts.wall_s()
                    )

    def _start(self, item: Item) -> None:
        self._item = item.id
        self._parts.say(f"item {item.id} begins: {item.title}")
        try:
            self._process = self._parts.start(item, self._generation)
        except OSError as error:
            self._not_begun = f"its process cannot be started: {error.strerror}"
            self._end_not_begun()

    def _end_not_begun(self) -> None:
        change = self._store.change(
            lambda s: machine.ended(
                s, self._item, machine.SHORT, self._parts.wall_s(), said=self._not_begun
            )
        )
        self._not_begun = ""
        self._act(change)

    def _end_process(self) -> None:
        """Ask the item's process to end, once; kill it when it does not."""
        if self._process is None:
            return
        now_s = self._parts.clock_s()
        if self._asked_to_end_s is None:
            self._asked_to_end_s = now_s
            self._process.end()
        elif now_s - self._asked_to_end_s > KILL_AFTER_S:
            self._process.kill()

    def _may_go_on(self) -> bool:
        """Whether the running item may go on while nothing can be written: within the arming."""
        with contextlib.suppress(StoreError):
            snapshot = self._store.snapshot()
            arming = snapshot.arming
            if arming is None or snapshot.end_item:
                return not snapshot.end_item
            spent = machine.used(snapshot, self._usage).after.arming
            assert spent is not None
            return not machine.limit_reached(spent, self._parts.wall_s())
        return False

    def _note_log(self, view: BenchSnapshot) -> None:
        if view.being_recorded and view.recording not in self._store.logs(self._item):
            self._store.add_log(self._item, view.recording)

    def _save_logs(self, item: Item) -> None:
        """Close or recover the run logs of an item that was interrupted."""
        view = self._parts.watch.look(now=True)
        until_s = self._parts.clock_s() + SAVE_WITHIN_S
        self._unsaved |= dict.fromkeys(self._logs_of(item, view), until_s)
        self._save_again(view)

    def _save_again(self, view: BenchSnapshot) -> None:
        """Save what could not be: the lease of a killed item keeps its log for two seconds."""
        for path, until_s in list(self._unsaved.items()):
            try:
                self._save_log(path, view)
            except (SmadError, OSError) as error:
                if self._parts.clock_s() < until_s:
                    continue
                self._parts.say(f"run log {path}: {error}")
            del self._unsaved[path]

    def _logs_of(self, item: Item, view: BenchSnapshot) -> list[Path]:
        """Return the logs that were noted, and those written since the item began.

        What the daemon records now, and was not noted, somebody else has begun.
        """
        noted = [Path(path) for path in self._store.logs(item.id)]
        # A daemon that was killed cannot say where it recorded: where it did before.
        folders = {self._store.path.parent, *(path.parent for path in noted)}
        folders |= {Path(folder) for folder in (view.folder, self._folder) if folder}
        # A clock that was set back meanwhile makes the log that was open older than its item.
        since_s = min(item.started_unix_s or 0.0, self._parts.wall_s()) - _BEFORE_S
        for folder in sorted(folders):
            with contextlib.suppress(OSError):
                for path in sorted(folder.glob(f"*{SUFFIX}")):
                    others = view.being_recorded and path == Path(view.recording)
                    if path.stat().st_mtime >= since_s and path not in noted and not others:
                        noted.append(path)
        return [path for path in noted if path.exists() and ".recovered" not in path.suffixes]

    def _save_log(self, path: Path, view: BenchSnapshot) -> None:
        if being_written(path):
            if view.generation is None:
                raise QueueError("its daemon does not answer")
            if view.being_recorded and Path(view.recording) == path:
                self._parts.watch.stop_recording()
                self._parts.say(f"run log {path}: closed")
            return
        if recovered_path(path).exists():
            return
        try:
            recovery = recover(path)
        except RunLogError as error:
            if "is whole" not in str(error):
                self._parts.say(f"run log {path}: {error}")
            return
        self._parts.say(f"run log {path}: recovered to {recovery.path}")


def run_queue(
    opened: Queue, *, check: Callable[[Item], Obstacle | None], say: Say, until_paused: bool
) -> None:
    """Carry a queue out, for ever or until it pauses. Raises QueueError where another does.

    `say` is told what happens, and when.
    """

    def stamped(text: str) -> None:
        say(f"{clock(time.time())}  {text}")

    lease = RunnerLease(opened.folder)
    lease.acquire()
    watch = BenchWatch(opened.bench, clock_s=time.monotonic)
    start = functools.partial(
        begin_item,
        folder=opened.folder.resolve(),
        bench=opened.bench,
        descriptor=lease.descriptor,
    )
    runner = Runner(opened.store, RunnerParts(watch=watch, start=start, check=check, say=stamped))
    try:
        runner.begin()
        stamped(f"runner of {opened.folder}: {state_in_words(opened.snapshot(), runner=True)}")
        runner.run(until_paused=until_paused)
    finally:
        runner.close()
        watch.close()
        lease.release()
