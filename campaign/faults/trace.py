"""A simulated bench that keeps a trace of its gate, its heat and its states, for the oracle."""

from __future__ import annotations

import bisect
import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState
from sim_device.bench import SimulatedBench
from sim_device.faults import Injection
from sim_device.plant.units import ZERO_C

HOT = (BoardState.ARMED, BoardState.HOLD)


@dataclass
class Trace:
    """What happened, sample by sample: times in us of bench time, heat of both springs in J."""

    t_us: list[int] = field(default_factory=list)
    heat_J: list[float] = field(default_factory=list)
    hottest_degC: list[float] = field(default_factory=list)
    """The hotter wire itself, whatever its sensor says."""
    changes: list[tuple[int, BoardState, bool]] = field(default_factory=list)
    """(time, state, gate open) whenever one of the two changed."""

    def add(self, t_us: int, heat_J: float, hottest_degC: float, state: int, gate: bool) -> None:
        """Take one sample."""
        self.t_us.append(t_us)
        self.heat_J.append(heat_J)
        self.hottest_degC.append(hottest_degC)
        if not self.changes or self.changes[-1][1:] != (state, gate):
            self.changes.append((t_us, BoardState(state), gate))

    def heat_at(self, t_us: int) -> float:
        """Heat until the last sample at or before `t_us`, in J; 0 before the first."""
        index = bisect.bisect_right(self.t_us, t_us)
        return self.heat_J[index - 1] if index else 0.0

    def hottest_since(self, t_us: int) -> float:
        """The hottest that a wire was from `t_us` on, in °C."""
        return max(self.hottest_degC[bisect.bisect_left(self.t_us, t_us) :], default=math.nan)

    def safe_at(self, onset_us: int) -> int | None:
        """When the bench first was safe after `onset_us`: gate off and neither ARMED nor HOLD."""
        for n, (t_us, state, gate) in enumerate(self.changes):
            ends_us = self.changes[n + 1][0] if n + 1 < len(self.changes) else None
            if ends_us is not None and ends_us <= onset_us:
                continue
            if state not in HOT and not gate:
                return max(t_us, onset_us)
        return None


class WatchedBench(SimulatedBench):
    """A simulated bench with a trace.

    `host` is who may be stalled by an injection, if anyone. `arriving` takes injections from
    another thread; they begin with the next sample.
    """

    def __init__(self, **options: Any) -> None:
        self.trace = Trace()
        self.host: Any = None
        self.arriving: deque[Injection] = deque()
        super().__init__(**options)

    def advance(self) -> wire.State | None:
        """Advance by one sample and note what came of it."""
        while self.arriving:
            # Its time is now, so that what lasts a while lasts that long from now on.
            self.faults.add(replace(self.arriving.popleft(), at_us=self.now_us))
        state = super().advance()
        outputs = self.board.outputs
        hottest_degC = max(self.plant.T_K) - ZERO_C
        self.trace.add(self.now_us, self.heater_J, hottest_degC, outputs.state, bool(outputs.gate))
        return state
