"""Which samples are new: by the board's time, axis by axis, and how many are missing between."""

from __future__ import annotations

from firmware_protocol.messages import State
from firmware_protocol.stats import HostLinkStats
from firmware_protocol.timesync import WRAP


class SampleOrder:
    """Lets each axis's samples through in rising order of time, counting what it sees."""

    def __init__(self, stats: HostLinkStats) -> None:
        self._stats = stats
        self._last: dict[int, tuple[int, int]] = {}

    def accept(self, state: State) -> bool:
        """Return whether the sample is newer than all before it."""
        last = self._last.get(state.axis)
        if last is not None:
            t_us, tick = last
            if not 0 < (state.t_us - t_us) % WRAP < WRAP // 2:
                self._stats.old_states += 1
                return False
            self._stats.missed_states += (state.tick - tick - 1) & 0xFFFF
        self._last[state.axis] = (state.t_us, state.tick)
        self._stats.states += 1
        return True
