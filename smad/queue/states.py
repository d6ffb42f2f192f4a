"""The records of a queue, and the table of what may follow what (docs/decisions/0613-queue.md).

Everything here is immutable. Times named `unix_s` are of the wall clock, for people; durations are
of the monotonic clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Literal

import msgspec
from msgspec import Struct

from smad.queue.errors import QueueError


class State(StrEnum):
    """Where an item stands."""

    QUEUED = "queued"
    RUNNING = "running"
    INTERRUPTED = "interrupted"
    DONE = "done"
    FAILED = "failed"
    REMOVED = "removed"


FOLLOWING: Mapping[State, frozenset[State]] = {
    State.QUEUED: frozenset({State.RUNNING, State.FAILED, State.REMOVED}),
    State.RUNNING: frozenset({State.DONE, State.FAILED, State.INTERRUPTED}),
    State.INTERRUPTED: frozenset(),
    State.DONE: frozenset(),
    State.FAILED: frozenset(),
    State.REMOVED: frozenset(),
}
"""Nothing leads back to `queued` or from an end to `running`: no item runs twice."""


class Item(Struct, frozen=True, kw_only=True):
    """One command in the queue. `words` follow `smad` on a command line, given in `folder`.

    It gets `id` and `position` when it is added; `position` orders the queued ones. `reason` says
    why it stands where it does. What is not `on_bench` is simulated, and needs no daemon.
    """

    id: int = 0
    position: float = 0.0
    kind: str
    title: str
    words: tuple[str, ...]
    folder: str = "."
    on_bench: bool = True
    state: State = State.QUEUED
    reason: str = ""
    added_unix_s: float = 0.0
    started_unix_s: float | None = None
    ended_unix_s: float | None = None
    exit_status: int | None = None


class Budget(Struct, frozen=True, kw_only=True):
    """What an armed queue may use before it pauses; None: as much as it needs."""

    energy_J: float | None = None
    cycles: float | None = None
    hours: float | None = None


class Usage(Struct, frozen=True, kw_only=True):
    """What was used since the queue was armed."""

    energy_J: float = 0.0
    cycles: float = 0.0
    seconds: float = 0.0

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            energy_J=self.energy_J + other.energy_J,
            cycles=self.cycles + other.cycles,
            seconds=self.seconds + other.seconds,
        )


class Arming(Struct, frozen=True, kw_only=True):
    """What a person confirmed: these items, until `end_unix_s` or for `longest_s`, this budget.

    `generation` is that of the bench's stops at the confirmation; None: no daemon was asked.
    """

    items: tuple[int, ...]
    end_unix_s: float
    longest_s: float
    budget: Budget = Budget()
    usage: Usage = Usage()
    generation: int | None = None


Mode = Literal["paused", "running"]


class Snapshot(Struct, frozen=True, kw_only=True):
    """The whole queue at one moment. `arming` is there exactly while `mode` is running."""

    items: tuple[Item, ...] = ()
    mode: Mode = "paused"
    reason: str = "nobody has armed it yet"
    end_item: bool = False
    """The running item is to be ended."""
    arming: Arming | None = None

    @property
    def running(self) -> Item | None:
        """The item that is running."""
        return next((item for item in self.items if item.state is State.RUNNING), None)

    @property
    def queued(self) -> tuple[Item, ...]:
        """The items that wait, in the order in which they will run."""
        waiting = (item for item in self.items if item.state is State.QUEUED)
        return tuple(sorted(waiting, key=lambda item: (item.position, item.id)))

    def item(self, number: int) -> Item:
        """Return the item with this number. Raises QueueError."""
        for item in self.items:
            if item.id == number:
                return item
        raise QueueError(
            "the queue has no such item", value=number, action="smad queue list --all shows them"
        )


def moved(item: Item, state: State, reason: str = "", **changes: object) -> Item:
    """Return the item in another state. Raises QueueError for a change that is in no table."""
    if state not in FOLLOWING[item.state]:
        raise QueueError(
            f"item {item.id} is {item.state} and cannot become {state}",
            limit=", ".join(sorted(FOLLOWING[item.state])) or "nothing: it has ended",
            action="add it again with smad queue again",
        )
    return msgspec.structs.replace(item, state=state, reason=reason, **changes)
