"""A queue as a program sees it: add, look, move, remove, arm, pause. The runner is another process.

What needs the command line's own checks goes through it: `add` runs `smad queue add`.
"""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import msgspec

from smad.client import Client
from smad.client.folder import recording_folder
from smad.errors import SmadError
from smad.queue import arming, machine
from smad.queue.budget import require_metered
from smad.queue.errors import ArmingError, QueueError
from smad.queue.lease import RunnerLease
from smad.queue.machine import Change
from smad.queue.states import Budget, Item, Snapshot
from smad.queue.store import FILE, Message, Proposal, Store

_ALPHABET = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
"""Of codes that people type: nothing that looks like something else."""


def now_zoned() -> datetime:
    """Now, in the zone of this computer, which knows when clocks change, where it has one."""
    now = datetime.now().astimezone()
    name = os.environ.get("TZ", "").lstrip(":")
    link = os.path.realpath("/etc/localtime")
    name = name or link.partition("zoneinfo/")[2]
    try:
        return now.astimezone(ZoneInfo(name))
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return now


class Queue:
    """The queue in `folder`, by default where the daemon of `bench` keeps its run logs.

    Raises StoreError when its file cannot be used.
    """

    def __init__(self, folder: str | Path | None = None, *, bench: str = "bench") -> None:
        self.folder = (
            Path(folder) if folder is not None else recording_folder(bench) or Path("runs")
        )
        self.bench = bench
        self.store = Store(self.folder / FILE)

    def __enter__(self) -> Queue:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.store.close()

    def snapshot(self) -> Snapshot:
        """Return items, mode, and what the arming allows and has used."""
        return self.store.snapshot()

    @property
    def has_runner(self) -> bool:
        """Whether a runner is there to carry the queue out."""
        return RunnerLease(self.folder).runs()

    def messages(self, after: int = 0) -> tuple[Message, ...]:
        """Return what happened, oldest first; `after` a message's number, what came since."""
        return self.store.messages(after)

    def add(self, kind: str, *words: str, repeat: int = 1) -> tuple[Item, ...]:
        """Add a command, checked as the command line checks it; `repeat` adds it so many times.

        `kind` is run, tune, checkup or move; `words` follow it as after `smad queue add`. Raises
        QueueError with what the command line says.
        """
        command = [sys.executable, "-m", "smad", "queue", "add", "--json", f"--repeat={repeat}"]
        command += [f"--folder={self.folder}", f"--bench={self.bench}", kind, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise QueueError(done.stderr.strip().removeprefix("smad: ") or "it was refused")
        return tuple(msgspec.convert(entry, Item) for entry in json.loads(done.stdout))

    def add_checked(self, items: Sequence[Item]) -> tuple[Item, ...]:
        """Append items that were checked."""
        now_s = time.time()
        return self.store.add([msgspec.structs.replace(item, added_unix_s=now_s) for item in items])

    def again(self, number: int) -> Item:
        """Add an item anew that has ended; nothing of the old one changes."""
        old = self.snapshot().item(number)
        if not old.ended_unix_s:
            raise QueueError(f"item {number} has not ended", action="nothing was added")
        item = Item(
            kind=old.kind,
            title=old.title,
            words=old.words,
            folder=old.folder,
            on_bench=old.on_bench,
        )
        return self.add_checked([item])[0]

    def remove(self, number: int) -> Change:
        """Take a queued item away. Raises QueueError for any other."""
        return self.store.change(lambda s: machine.removed(s, number, time.time()))

    def move(self, number: int, place: int) -> Change:
        """Make a queued item the `place`-th of those that wait, from 1. Raises QueueError."""
        return self.store.change(lambda s: machine.placed(s, number, place))

    def pause(self, reason: str = "paused by hand", *, now: bool = False) -> Change:
        """Let nothing more begin; `now` ends what runs, in order."""
        change = self.store.change(lambda s: machine.paused(s, reason, end_item=now))
        self.store.add_message("queue_paused", reason, None, time.time())
        return change

    def propose(self, end_unix_s: float, budget: Budget) -> Proposal:
        """First step of arming: what would run until then, under a code. Raises ArmingError."""
        require_metered(budget, self.bench)
        proposal = arming.propose(
            self.snapshot(),
            code="".join(secrets.choice(_ALPHABET) for _ in range(4)),
            now_unix_s=time.time(),
            end_unix_s=end_unix_s,
            budget=budget,
            generation=self._generation(),
        )
        self.store.propose(proposal)
        return proposal

    def confirm(self, code: str) -> Snapshot:
        """Second step: the queue runs. Raises ArmingError, also without a runner.

        A runner that begins pauses an armed queue, since it cannot know what happened before.
        """
        if not self.has_runner:
            raise ArmingError(
                "the queue has no runner", action="start smad queue run first; nothing was armed"
            )
        proposal, generation = self.store.proposal(), self._generation()
        change = self.store.change(
            lambda s: arming.confirm(
                s, proposal, code, now_unix_s=time.time(), generation=generation
            )
        )
        self.store.propose(None)
        return change.after

    def _generation(self) -> int | None:
        try:
            with Client(self.bench, timeout_s=1.0) as client:
                return client.motion().generation
        except SmadError:
            return None
