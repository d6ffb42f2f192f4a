"""What happens next to a queue: pure functions from a snapshot, an event and the time.

Rule 1: everything that decides about items is here. Rule 2: nothing here reads a clock or a file.
Each function returns a `Change`: the records to write in one transaction, and then, only after
that, the actions to carry out.
"""

from collections.abc import Mapping
from typing import Literal

import msgspec
from msgspec import Struct

from smad.queue.errors import QueueError
from smad.queue.states import Arming, Item, Snapshot, State, Usage, moved

STOPPED, TRIPPED, LOST, SHORT = 3, 4, 5, 6
"""Exit statuses of an item's process: the bench was stopped or taken away; a fault; daemon or board
do not answer; this computer lacks disk, memory or time."""


class StartItem(Struct, frozen=True):
    """Begin the process of an item that is written as running."""

    item: Item


class EndItem(Struct, frozen=True):
    """Ask the process of the running item to disarm and end."""

    item: Item
    reason: str


class PostMessage(Struct, frozen=True):
    """Something happened that people want to hear of: an item ended, or the queue paused."""

    event: Literal["item_ended", "queue_ended", "queue_paused"]
    text: str
    item: Item | None = None


Action = StartItem | EndItem | PostMessage


class Readiness(Struct, frozen=True):
    """Whether an item may begin on the bench now; `trouble` says why not without a person.

    Neither ready nor in trouble: it cools, or somebody uses it, and the queue waits.
    """

    ready: bool
    trouble: str = ""


class Obstacle(Struct, frozen=True):
    """Why an item cannot begin. One `of_computer`, such as a full disk, would meet them all."""

    text: str
    of_computer: bool = False


class Change(Struct, frozen=True, kw_only=True):
    """What to write, and what to do afterwards. `after` is the snapshot once it is written."""

    after: Snapshot
    items: tuple[Item, ...] = ()
    actions: tuple[Action, ...] = ()


class Ending(Struct, frozen=True):
    """What an exit status makes of an item, and why the queue then pauses, if it does."""

    state: State
    pauses: bool
    reason: str


ENDINGS: Mapping[int, Ending] = {
    0: Ending(State.DONE, pauses=False, reason=""),
    STOPPED: Ending(State.INTERRUPTED, pauses=True, reason="the bench was stopped"),
    TRIPPED: Ending(State.FAILED, pauses=True, reason="a fault or a limit stopped the bench"),
    LOST: Ending(State.INTERRUPTED, pauses=True, reason="the daemon or the board does not answer"),
    SHORT: Ending(
        State.INTERRUPTED, pauses=True, reason="this computer is out of disk space or memory"
    ),
}
_ERROR = Ending(State.FAILED, pauses=False, reason="it ended with an error")
_KILLED = Ending(State.INTERRUPTED, pauses=True, reason="its process was killed")
_KILLED_BY_SHELL = 128


def ending_of(status: int) -> Ending:
    """Return what an exit status means; negative, or above 128, a signal ended the process."""
    if status < 0 or status > _KILLED_BY_SHELL:
        return _KILLED
    return ENDINGS.get(status, _ERROR)


def recover(snapshot: Snapshot, now_unix_s: float) -> Change:
    """Return the change for a runner that begins: what was running is interrupted, never rerun."""
    item = snapshot.running
    if item is None:
        if snapshot.mode == "paused":
            return Change(after=snapshot)
        return paused(snapshot, "the runner was started anew")
    reason = f"the runner ended while item {item.id} ran"
    ended = moved(item, State.INTERRUPTED, reason, ended_unix_s=now_unix_s)
    change = _ended(snapshot, ended)
    return _merged(change, paused(change.after, reason))


def paused(snapshot: Snapshot, reason: str, *, end_item: bool = False) -> Change:
    """Return the change that pauses the queue, and with `end_item` ends what runs."""
    item = snapshot.running
    ends = end_item and item is not None
    after = msgspec.structs.replace(
        snapshot, mode="paused", reason=reason, arming=None, end_item=ends or snapshot.end_item
    )
    actions: tuple[Action, ...] = (PostMessage("queue_paused", reason),)
    if ends and item is not None:
        actions = (EndItem(item, reason), *actions)
    return Change(after=after, actions=actions)


def resumed(snapshot: Snapshot, arming: Arming) -> Change:
    """Return the change that arms the queue. Raises QueueError while an item still runs."""
    if snapshot.mode == "running":
        raise QueueError("the queue is running already", action="pause it first")
    if snapshot.running is not None:
        raise QueueError(
            f"item {snapshot.running.id} is still running",
            action="wait for its end, or smad queue pause --now",
        )
    after = msgspec.structs.replace(
        snapshot, mode="running", reason="", arming=arming, end_item=False
    )
    return Change(after=after)


def used(snapshot: Snapshot, usage: Usage) -> Change:
    """Return the change that adds what was used since the last one."""
    if snapshot.arming is None:
        return Change(after=snapshot)
    arming = msgspec.structs.replace(snapshot.arming, usage=snapshot.arming.usage + usage)
    return Change(after=msgspec.structs.replace(snapshot, arming=arming))


def limit_reached(arming: Arming, now_unix_s: float) -> str:
    """Return which limit of the arming is reached, in words; empty while none is."""
    usage, budget = arming.usage, arming.budget
    hours = usage.seconds / 3600.0
    if now_unix_s >= arming.end_unix_s or usage.seconds >= arming.longest_s:
        return "the end time of the arming has come"
    if budget.energy_J is not None and usage.energy_J >= budget.energy_J:
        return f"the budget of energy is used up ({usage.energy_J / 1e3:.1f} kJ)"
    if budget.cycles is not None and usage.cycles >= budget.cycles:
        return f"the budget of cycles is used up ({usage.cycles:.0f})"
    if budget.hours is not None and hours >= budget.hours:
        return f"the budget of hours is used up ({hours:.2f} h)"
    return ""


def candidate(snapshot: Snapshot) -> Item | None:
    """Return the item that would start now, if nothing speaks against it."""
    if snapshot.mode != "running" or snapshot.running is not None or not snapshot.queued:
        return None
    return snapshot.queued[0]


def step(
    snapshot: Snapshot,
    now_unix_s: float,
    bench: Readiness,
    *,
    obstacles: Mapping[int, Obstacle] | None = None,
) -> Change:
    """Return what happens now: an item begins, is ended by a limit, or the queue ends.

    `obstacles` are those of the items that were looked at just now and cannot begin.
    """
    if snapshot.mode == "paused":
        item = snapshot.running
        if item is None or not snapshot.end_item:
            return Change(after=snapshot)
        return Change(after=snapshot, actions=(EndItem(item, snapshot.reason),))
    assert snapshot.arming is not None
    limit = limit_reached(snapshot.arming, now_unix_s)
    if limit:
        return paused(snapshot, limit, end_item=True)
    if snapshot.running is not None:
        return Change(after=snapshot)
    item = candidate(snapshot)
    if item is None:
        return _queue_ended(snapshot)
    if item.id not in snapshot.arming.items:
        return paused(snapshot, f"item {item.id} was added after the queue was armed")
    obstacle = (obstacles or {}).get(item.id)
    if obstacle is not None and obstacle.of_computer:
        return paused(snapshot, f"item {item.id} cannot begin: {obstacle.text}")
    if obstacle is not None:
        return _ended(snapshot, moved(item, State.FAILED, obstacle.text, ended_unix_s=now_unix_s))
    if item.on_bench and not bench.ready:
        return paused(snapshot, bench.trouble) if bench.trouble else Change(after=snapshot)
    started = moved(item, State.RUNNING, started_unix_s=now_unix_s)
    return Change(
        after=_with_items(snapshot, started), items=(started,), actions=(StartItem(started),)
    )


def ended(
    snapshot: Snapshot, number: int, status: int, now_unix_s: float, *, said: str = ""
) -> Change:
    """Return the change for the end of an item's process; `said` is the last line it printed."""
    item = snapshot.item(number)
    ending = ending_of(status)
    # What a killed process said last is where it was, not why it ended.
    words = ending.reason if ending is _KILLED else said or ending.reason
    if snapshot.end_item and status != 0:
        # Asked to end, by a person or a limit: that is the reason, not what the process said of it.
        ending, words = Ending(State.INTERRUPTED, True, snapshot.reason), snapshot.reason
    over = moved(item, ending.state, words, ended_unix_s=now_unix_s, exit_status=status)
    change = _ended(msgspec.structs.replace(snapshot, end_item=False), over)
    if not ending.pauses or snapshot.mode == "paused":
        return change
    return _merged(change, paused(change.after, f"item {number}: {words}"))


def removed(snapshot: Snapshot, number: int, now_unix_s: float) -> Change:
    """Return the change that takes a queued item away. Raises QueueError for any other."""
    item = snapshot.item(number)
    if item.state is State.RUNNING:
        raise QueueError(
            f"item {number} is running", action="smad queue pause --now ends it; nothing changed"
        )
    item_removed = moved(item, State.REMOVED, "removed", ended_unix_s=now_unix_s)
    return Change(after=_with_items(snapshot, item_removed), items=(item_removed,))


def placed(snapshot: Snapshot, number: int, place: int) -> Change:
    """Return the change that makes a queued item the `place`-th of those that wait, from 1."""
    item = snapshot.item(number)
    if item.state is not State.QUEUED:
        raise QueueError(
            f"item {number} is {item.state}", limit="a queued item", action="nothing was changed"
        )
    others = [other for other in snapshot.queued if other.id != number]
    if not 1 <= place <= len(others) + 1:
        raise QueueError("there is no such place", value=place, limit=f"1 to {len(others) + 1}")
    order = [*others[: place - 1], item, *others[place - 1 :]]
    items = tuple(
        msgspec.structs.replace(entry, position=float(position))
        for position, entry in enumerate(order, 1)
    )
    return Change(after=_with_items(snapshot, *items), items=items)


def _queue_ended(snapshot: Snapshot) -> Change:
    change = paused(snapshot, "every item has ended")
    return Change(after=change.after, actions=(PostMessage("queue_ended", "every item has ended"),))


def _ended(snapshot: Snapshot, item: Item) -> Change:
    """Return the change that an item has ended so, and says so."""
    why = f": {item.reason}" if item.reason else ""
    text = f"item {item.id} ({item.title}) {item.state}{why}"
    said = PostMessage("item_ended", text, item)
    return Change(after=_with_items(snapshot, item), items=(item,), actions=(said,))


def _with_items(snapshot: Snapshot, *changed: Item) -> Snapshot:
    by_number = {item.id: item for item in changed}
    items = tuple(by_number.get(item.id, item) for item in snapshot.items)
    return msgspec.structs.replace(snapshot, items=items)


def _merged(first: Change, second: Change) -> Change:
    return Change(
        after=second.after,
        items=(*first.items, *second.items),
        actions=(*first.actions, *second.actions),
    )
