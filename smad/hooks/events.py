"""What happened between two looks at a bench and its queue. Pure: looks and time are arguments."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import msgspec
from msgspec import Struct

from smad.api import Fault, Status
from smad.config import HooksConfig
from smad.queue.states import Snapshot
from smad.queue.store import Message

Name = Literal["on_fault", "on_stop", "on_link_lost", "on_queue_end", "on_disk_low"]
SILENT_S = 1.5
"""A daemon that has not answered for so long is told as lost."""
_ROOM_AGAIN = 1.1
"""The disk is told anew once there was so much more room than the limit."""
_BY_DISARM = "stopped by disarm of "
MOST_AT_ONCE = 5
"""Messages of the queue that are told one by one; of more, such as after an outage, in one word."""


class Event(Struct, frozen=True, kw_only=True):
    """What a hook gets, as JSON: which hook, which bench, when, and what happened."""

    event: Name
    bench: str
    unix_s: float
    text: str
    data: Mapping[str, Any] = {}


class Observation(Struct, frozen=True, kw_only=True):
    """One look. `status` is None while no daemon answers; `snapshot` while there is no queue.

    `message` is the number of the queue's last message.
    """

    unix_s: float
    clock_s: float
    status: Status | None = None
    free_MB: float | None = None
    snapshot: Snapshot | None = None
    messages: tuple[Message, ...] = ()
    message: int = 0
    has_runner: bool = True


class WatcherState(Struct, frozen=True, kw_only=True):
    """What was seen last, and told. Kept in a file, it lets the next watcher catch up."""

    message: int = 0
    """Number of the queue's last message."""
    armed: bool = False
    generation: int = 0
    holder: str = ""
    fault: Fault | None = None


class Detector:
    """Compares each look with the one before; the first one with `known`, of an earlier watcher.

    `known` is what has been told by now.
    """

    def __init__(
        self, bench: str, config: HooksConfig, *, known: WatcherState | None = None
    ) -> None:
        self._config = config
        self.known = known or WatcherState()
        self._bench = bench
        self._watched = False
        """Whether the bench was seen by this watcher."""
        self._answered_s: float | None = None
        self._lost = False
        self._disk_told = False
        self._runner_told = False

    def events(self, look: Observation) -> list[Event]:
        """Return what happened since the look before, in the order in which it matters."""
        happened = [*self._of_link(look)]
        if look.status is not None:
            happened += [*self._of_bench(look, look.status)]
            self._watched = True
            motion = look.status.motion
            self.known = msgspec.structs.replace(
                self.known,
                armed=motion.armed,
                generation=motion.generation,
                holder=look.status.control.holder,
                fault=motion.fault,
            )
        happened += [*self._of_queue(look), *self._of_disk(look)]
        return happened

    def _event(self, look: Observation, event: Name, text: str, **data: Any) -> Event:
        return Event(event=event, bench=self._bench, unix_s=look.unix_s, text=text, data=data)

    def _of_link(self, look: Observation) -> Iterator[Event]:
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

    def _of_bench(self, look: Observation, status: Status) -> Iterator[Event]:
        before, fault = self.known, status.motion.fault
        if fault is not None and before.fault != fault:
            yield self._event(
                look, "on_fault", fault.in_words(), number=fault.number, name=fault.name
            )
            return
        if not before.armed or fault is not None:
            return
        motion = status.motion
        # Which programs ran while nobody watched is not known: each disarms in the end.
        by_program = (
            motion.ended == f"{_BY_DISARM}{before.holder}"
            if self._watched
            else motion.ended.startswith(_BY_DISARM)
        )
        if motion.ended and motion.generation != before.generation and not by_program:
            yield self._event(look, "on_stop", motion.ended)

    def _of_queue(self, look: Observation) -> Iterator[Event]:
        if len(look.messages) > MOST_AT_ONCE:
            yield self._event(
                look,
                "on_queue_end",
                f"{len(look.messages)} messages, the last: {look.messages[-1].text}",
                kind="several",
                messages=[message.text for message in look.messages],
            )
        else:
            for message in look.messages:
                event = self._event(
                    look, "on_queue_end", message.text, kind=message.event, item=message.item
                )
                # It may be hours old.
                yield msgspec.structs.replace(event, unix_s=message.unix_s)
        snapshot = look.snapshot
        if snapshot is None:
            return
        self.known = msgspec.structs.replace(self.known, message=look.message)
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

    def _of_disk(self, look: Observation) -> Iterator[Event]:
        free_MB = look.free_MB
        if free_MB is None:
            return
        least_MB = self._config.disk_low_MB
        if free_MB < least_MB and not self._disk_told:
            self._disk_told = True
            yield self._event(
                look,
                "on_disk_low",
                f"{free_MB:.0f} MB left for run logs, less than {least_MB:g} MB",
                free_MB=free_MB,
            )
        elif free_MB > least_MB * _ROOM_AGAIN:
            self._disk_told = False
