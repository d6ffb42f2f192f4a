"""Motions of several axes that begin together, and how far apart their boards began them.

All are checked before any begins. They begin at one instant of the host, each at the next sample
of its board. A group that is queued begins when the slowest of its axes has ended what it does.
"""

from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping

from firmware_protocol.messages import State
from smad.control.commands import Follow
from smad.daemon.axis import Axis
from smad.daemon.histogram import Histogram
from smad.daemon.services import Say
from smad.errors import CommandError

MOST_WAITING = 1000
"""Groups; each is looked at with every sample until it begins."""

Group = Mapping[str, Follow]
"""What each axis, by name, is to follow."""


class Groups:
    """Begins groups, and keeps those that wait. `axes` are those of the bench, by name."""

    def __init__(self, axes: Mapping[str, Axis], say: Say) -> None:
        self.skew = Histogram()
        """How far apart, on the host's clock, the boards took the samples that a group began at."""
        self.ended = Counter[str]()
        """How often what an axis does was ended or replaced, by a command or a stop."""
        self._axes = axes
        self._say = say
        self._waiting: deque[Group] = deque()

    def begin(self, group: Group) -> None:
        """Begin a group now. Raises CommandError, with nothing begun, when one cannot."""
        self._begin(group)
        self.forget(group)

    def _begin(self, group: Group) -> None:
        self._check(group)
        at_us: dict[str, float | None] = {}

        def beginning(axis: Axis) -> Callable[[State], None]:
            def on_sample(state: State) -> None:
                at_us[axis.name] = axis.session.host_us(state.t_us)
                if len(at_us) == len(group):
                    self._tell_skew({n: t for n in group if (t := at_us[n]) is not None})

            return on_sample

        for name, follow in group.items():
            axis = self._axes[name]
            axis.controller.command(follow)
            axis.control.on_next = beginning(axis)

    def queue(self, group: Group) -> None:
        """Begin a group once its slowest axis has ended. Raises CommandError if it never could."""
        self._check(group)
        if len(self._waiting) >= MOST_WAITING:
            raise CommandError(
                "too many motions of several axes wait",
                value=len(self._waiting),
                limit=MOST_WAITING,
                action="queue it once one of them has begun",
            )
        self._waiting.append(group)

    def wait_for(self, name: str) -> bool:
        """Whether a group that has not begun has this axis."""
        return any(name in group for group in self._waiting)

    def look(self) -> None:
        """Begin what waits and can; none overtakes an earlier one that has an axis in common."""
        blocked_axes: set[str] = set()
        for group in tuple(self._waiting):
            if len(blocked_axes) == len(self._axes):
                return
            if blocked_axes.isdisjoint(group) and all(self._axes[n].controller.done for n in group):
                self._waiting.remove(group)
                try:
                    self._begin(group)
                except CommandError as error:
                    self._say("warning", f"a queued motion was left out: {error}", {})
            blocked_axes.update(group)

    def forget(self, names: Collection[str]) -> None:
        """Give up the groups that wait for one of these axes: it was stopped, or does another."""
        ended = set(names)
        self.ended.update(ended)
        for group in [group for group in self._waiting if not ended.isdisjoint(group)]:
            self._waiting.remove(group)

    def _check(self, group: Group) -> None:
        for name, follow in group.items():
            with self._axes[name].naming_axis():
                self._axes[name].controller.check(follow)

    def _tell_skew(self, at_us: Mapping[str, float]) -> None:
        if len(at_us) < 2:
            return
        skew_us = max(at_us.values()) - min(at_us.values())
        self.skew.add(round(skew_us * 1000))
        data = {"skew_us": round(skew_us, 1), "at_us": {n: round(t, 1) for n, t in at_us.items()}}
        self._say("command", f"{', '.join(at_us)} began within {skew_us / 1000:.2f} ms", data)
