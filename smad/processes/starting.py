"""Whether a process that starts still gets anywhere, by the processor time of it and its children.

A first start compiles the physics kernel. How long that takes by the clock depends on what else the
machine does; a process that hangs uses no processor.
"""

import os
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

STALLED_S = 120.0
LEAST_S = 0.5
"""So much processor time in STALLED_S is work; who only waits and looks uses less."""


def processor_s(pid: int) -> float:
    """Processor time of a process and all that it started and that runs, s. 0 where not Linux."""
    used: dict[int, int] = {}
    children = defaultdict(list)
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        process = int(stat.parent.name)
        used[process] = sum(map(int, words[11:15]))  # utime, stime, and of children that ended
        children[int(words[1])].append(process)
    ticks, tree = 0, [pid]
    while tree:
        process = tree.pop()
        ticks += used.get(process, 0)
        tree += children[process]
    return float(ticks / os.sysconf("SC_CLK_TCK"))


class StallDetector:
    """Says when a process has done nothing for STALLED_S."""

    def __init__(
        self,
        pid: int,
        *,
        clock_s: Callable[[], float] = time.monotonic,
        used_s: Callable[[int], float] = processor_s,
    ) -> None:
        self._pid = pid
        self._clock_s = clock_s
        self._used_s = used_s
        self._worked_s = clock_s()
        self._used_by_then_s = 0.0
        self._looked_s = self._worked_s

    def stalled(self) -> bool:
        """Return whether it has used less than LEAST_S of the processor for STALLED_S."""
        now_s = self._clock_s()
        if now_s - self._looked_s >= 1.0:
            self._looked_s = now_s
            used_s = self._used_s(self._pid)
            if used_s - self._used_by_then_s >= LEAST_S:
                self._worked_s, self._used_by_then_s = now_s, used_s
        return now_s - self._worked_s > STALLED_S
