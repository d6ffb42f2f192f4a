"""Services that every part of the daemon may use: clocks, journal, tasks beside the loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field, replace
from typing import Any

from smad.runlog.schema import EventKind

Say = Callable[[EventKind, str, dict[str, Any]], None]
"""Puts an event into run log and journal."""

Spawn = Callable[[str, Coroutine[Any, Any, None]], None]
"""Runs something beside the loop, under a name; if it dies, the daemon does."""


def monotonic_us() -> int:
    """The daemon's clock, microseconds."""
    return time.monotonic_ns() // 1000


@dataclass(frozen=True)
class Clocks:
    """The daemon's clock, the one that people mean (Unix time), and one for short durations."""

    us: Callable[[], int] = monotonic_us
    wall_s: Callable[[], float] = field(default_factory=lambda: time.time)
    stopwatch_ns: Callable[[], int] = time.perf_counter_ns


@dataclass(frozen=True)
class Services:
    """Clocks, log and tasks for a part of the daemon; `axis`: whose part, where it has a name."""

    clocks: Clocks
    say: Say
    spawn: Spawn
    axis: str = ""

    def named(self, axis: str) -> Services:
        """Return services whose events name the axis; themselves without a name."""
        if not axis:
            return self

        def say(kind: EventKind, text: str, data: dict[str, Any]) -> None:
            self.say(kind, f"{axis}: {text}", {"axis": axis, **data})

        return replace(self, say=say, axis=axis)
