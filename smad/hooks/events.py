"""What happened between two looks at a bench and its queue. Pure: looks and time are arguments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from msgspec import Struct

from smad.api import Status
from smad.queue.states import Snapshot
from smad.queue.store import Message

Name = Literal["on_fault", "on_stop", "on_link_lost", "on_queue_end", "on_disk_low"]
SILENT_S = 1.5
"""A daemon that has not answered for so long is told as lost."""
_ROOM_AGAIN = 1.1
"""The disk is told anew once there was so much more room than the limit."""
_OWN_DISARM = "stopped by disarm of "


class Event(Struct, frozen=True, kw_only=True):
    """What a hook gets, as JSON: which hook, which bench, when, and what happened."""

    event: Name
    bench: str
    unix_s: float
    text: str
    data: Mapping[str, Any] = {}


class Look(Struct, frozen=True, kw_only=True):
    """One look. `status` is None while no daemon answers; `snapshot` while there is no queue."""

    unix_s: float
    clock_s: float
    status: Status | None = None
    free_MB: float | None = None
    snapshot: Snapshot | None = None
    messages: tuple[Message, ...] = ()
    has_runner: bool = True


class Detector:
    """Compares each look with the one before."""

    def __init__(self, bench: str, *, disk_low_MB: float) -> None:
        self.disk_low_MB = disk_low_MB
        self._bench = bench
        self._before: Status | None = None
        self._answered_s: float | None = None
        self._lost = False
        self._disk_told = False
        self._runner_told = False

    def events(self, look: Look) -> list[Event]:
        """Return what happened since the look before, in the order in which it matters."""
        happened = [*self._of_link(look)]
        if look.status is not None:
            happened += [*self._of_bench(look, look.status)]
            self._before = look.status
        happened += [*self._of_queue(look), *self._of_disk(look)]
        return happened

    def _event(self, look: Look, event: Name, text: str, **data: Any) -> Event:
        return Event(event=event, bench=self._bench, unix_s=look.unix_s, text=text, data=data)

    def _of_link(self, look: Look) -> Iterator[Event]:
        if look.status is not None:
            lost = look.status.link.state == "disconnected"
            what = f"the board does not answer on {look.status.link.port}"
            self._answered_s = look.clock_s
        elif self._answered_s is None:
            return
        else:
            lost = self._lost or look.clock_s - self._answered_s >= SILENT_S
            what = "the daemon does not answer: it ended, or hangs"
        if lost and not self._lost:
            yield self._event(look, "on_link_lost", what)
        self._lost = lost

    def _of_bench(self, look: Look, status: Status) -> Iterator[Event]:
        before = None if self._before is None else self._before.motion
        fault = status.motion.fault
        if fault is not None and (before is None or before.fault != fault):
            yield self._event(
                look, "on_fault", fault.in_words(), number=fault.number, name=fault.name
            )
            return
        if before is None or self._before is None or not before.armed or fault is not None:
            return
        motion = status.motion
        by_program = f"{_OWN_DISARM}{self._before.control.holder}"
        if motion.ended and motion.generation != before.generation and motion.ended != by_program:
            yield self._event(look, "on_stop", motion.ended)

    def _of_queue(self, look: Look) -> Iterator[Event]:
        for message in look.messages:
            yield self._event(
                look, "on_queue_end", message.text, kind=message.event, item=message.item
            )
        snapshot = look.snapshot
        if snapshot is None:
            return
        abandoned = not look.has_runner and (
            snapshot.mode == "running" or snapshot.running is not None
        )
        if abandoned and not self._runner_told:
            item = snapshot.running
            what = "" if item is None else f" while item {item.id} ({item.title}) ran"
            yield self._event(
                look,
                "on_queue_end",
                f"the runner of the queue has ended{what}",
                kind="runner_lost",
                item=None if item is None else item.id,
            )
        self._runner_told = abandoned

    def _of_disk(self, look: Look) -> Iterator[Event]:
        free_MB = look.free_MB
        if free_MB is None:
            return
        if free_MB < self.disk_low_MB and not self._disk_told:
            self._disk_told = True
            yield self._event(
                look,
                "on_disk_low",
                f"{free_MB:.0f} MB left for run logs, less than {self.disk_low_MB:g} MB",
                free_MB=free_MB,
            )
        elif free_MB > self.disk_low_MB * _ROOM_AGAIN:
            self._disk_told = False
