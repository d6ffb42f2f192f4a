"""The queue as a page shows and changes it. All of it is files and processes: never the loop's."""

import time
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct

from smad.counted import counted
from smad.queue import Queue, QueueError
from smad.queue.states import Budget, Snapshot
from smad.queue.store import FILE

MOST_ENDED = 8
Text = Annotated[str, Meta(max_length=500)]


class Add(Struct, tag_field="verb", tag="add", frozen=True, kw_only=True):
    """Add a command: `what` is an experiment, a loop, a baseline or a file of moves."""

    kind: Literal["run", "tune", "checkup", "move"]
    what: Text = ""
    repeat: Annotated[int, Meta(ge=1, le=1000)] = 1

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        what = self.what.strip()
        if what.startswith("-"):
            action = "give options on the command line"
            raise QueueError("this is not a name", value=what, action=action)
        words = {
            "run": [what],
            "tune": [what] if what else [],
            "checkup": [f"--baseline={what}", "--quick"],
            "move": [str(queue.folder / what)],
        }[self.kind]
        added = queue.add(self.kind, *words, repeat=self.repeat)
        return "queued: " + ", ".join(f"item {item.id}" for item in added), ""


class Remove(Struct, tag_field="verb", tag="remove", frozen=True, kw_only=True):
    """Take a queued item away."""

    item: int

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        queue.remove(self.item)
        return f"item {self.item} removed", ""


class Again(Struct, tag_field="verb", tag="again", frozen=True, kw_only=True):
    """Add an item anew that has ended."""

    item: int

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        return f"queued: item {queue.again(self.item).id}", ""


class Place(Struct, tag_field="verb", tag="place", frozen=True, kw_only=True):
    """Make a queued item the `place`-th of those that wait."""

    item: int
    place: int

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        queue.move(self.item, self.place)
        return f"item {self.item} is now number {self.place} of the waiting items", ""


class Pause(Struct, tag_field="verb", tag="pause", frozen=True, kw_only=True):
    """Let nothing more begin; `now` ends what runs."""

    now: bool = False

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        queue.pause(now=self.now)
        return "paused", ""


class Propose(Struct, tag_field="verb", tag="propose", frozen=True, kw_only=True):
    """First step of arming the queue."""

    hours: Annotated[float, Meta(gt=0.0, le=744.0)]
    energy_kJ: Annotated[float, Meta(gt=0.0, le=1e9)] | None = None

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        energy_J = None if self.energy_kJ is None else self.energy_kJ * 1e3
        budget = Budget(hours=self.hours, energy_J=energy_J)
        proposal = queue.propose(time.time() + self.hours * 3600.0, budget)
        return (
            f"{counted(len(proposal.arming.items), 'item')} for at most {self.hours:g} h",
            proposal.code,
        )


class Confirm(Struct, tag_field="verb", tag="confirm", frozen=True, kw_only=True):
    """Second step, with the code of the first."""

    code: Annotated[str, Meta(max_length=16)]

    def carry_out(self, queue: Queue) -> tuple[str, str]:
        queue.confirm(self.code)
        return "the queue runs", ""


Verb = Add | Remove | Again | Place | Pause | Propose | Confirm


class Line(Struct, frozen=True, kw_only=True):
    """An item as a row of the table."""

    item: int
    title: str
    state: str
    why: str
    place: int = 0
    """Among those that wait, from 1; 0: it does not wait."""


class QueueState(Struct, frozen=True, kw_only=True):
    """The queue as a page shows it."""

    mode: str
    reason: str
    runner: bool
    end_unix_s: float | None
    lines: tuple[Line, ...]


def queue_state(folder: Path, bench: str) -> QueueState:
    """Return the queue of a folder; one that has no file yet is empty. Raises StoreError."""
    if not (folder / FILE).exists():
        return QueueState(
            mode="paused", reason="it is empty", runner=False, end_unix_s=None, lines=()
        )
    with Queue(folder, bench=bench) as queue:
        snapshot, runner = queue.snapshot(), queue.has_runner
    return QueueState(
        mode=snapshot.mode,
        reason=snapshot.reason,
        runner=runner,
        end_unix_s=snapshot.arming.end_unix_s if snapshot.arming else None,
        lines=_lines(snapshot),
    )


def carry_out(folder: Path, bench: str, verb: Verb) -> tuple[str, str]:
    """Do what a page asks of the queue; return what to say, and the code of a proposal.

    Raises QueueError.
    """
    with Queue(folder, bench=bench) as queue:
        return verb.carry_out(queue)


def _lines(snapshot: Snapshot) -> tuple[Line, ...]:
    ended = [item for item in snapshot.items if item.ended_unix_s][-MOST_ENDED:]
    running = [snapshot.running] if snapshot.running else []
    waiting = {item.id: place for place, item in enumerate(snapshot.queued, 1)}
    return tuple(
        Line(
            item=item.id,
            title=item.title,
            state=item.state,
            why=item.reason,
            place=waiting.get(item.id, 0),
        )
        for item in (*ended, *running, *snapshot.queued)
    )
