"""A bench of several axes on virtual time."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from campaign.virtual import Line
from sim_device.bench import SimulatedBench
from sim_device.faults import Injection
from smad.config import AxisConfig
from tests.smad.daemon.rig import Rig, rig_in

NAMES = ("pitch-1", "yaw-1", "pitch-2")
PHASE_US = 3_100
"""Boards do not sample at the same moments."""


def lines(
    names: Sequence[str] = NAMES,
    *,
    faults: Mapping[str, Sequence[Injection]] | None = None,
    rates_hz: Mapping[str, int] | None = None,
) -> dict[str, Line]:
    """A board for each axis that stores its name, each with a phase of its own."""
    made = {}
    for k, name in enumerate(names):
        bench = SimulatedBench(
            seed=k,
            faults=(faults or {}).get(name, ()),
            rate_hz=(rates_hz or {}).get(name, 100),
            axis_name=name,
        )
        made[name] = Line(bench, k * PHASE_US)
    return made


@contextlib.asynccontextmanager
async def axes_in(
    folder: Path,
    boards: Mapping[str, Line] | None = None,
    *,
    own: Sequence[str] = (),
    without_missing: bool = False,
    **sections: Any,
) -> AsyncIterator[Rig]:
    """A started daemon on several boards; the faults of those in `own` hold no other axis."""
    boards = lines() if boards is None else boards
    axes = tuple(
        AxisConfig(
            name=name,
            rate_hz=None if line.bench.period_us == 10_000 else 1_000_000 // line.bench.period_us,  # type: ignore[arg-type]
            fault_holds="own" if name in own else "all",
        )
        for name, line in boards.items()
    )
    async with rig_in(
        folder, boards, without_missing=without_missing, axes=axes, **sections
    ) as rig:
        yield rig
