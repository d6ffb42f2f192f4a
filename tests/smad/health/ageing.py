"""Benches that age: `python -m tests.smad.health.ageing --cycles 20000 --every 500 --seeds 3`.

A standard run is recorded in virtual time after every so many cycles, on benches whose springs
have them behind (effects that grow with cycles then act), on one whose pump weakens in proportion,
and on ones where nothing changes. The record and its trends are those of `smad health`. The cycles
between the standard runs are not simulated: effects depend on their number alone.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from sim_device.plant.models import built_in
from smad.control.commands import DriveCurrent, Follow, Sine
from smad.control.plan import Do, Pause, Plan, UntilDone
from smad.experiments.driver import log_path
from smad.experiments.virtual import VirtualDriver
from smad.health.measure import row_of
from smad.health.record import Row
from smad.health.report import Health, health_of

SHARE = 0.25
"""Of a full transformation that a spring makes in a cycle of the standard run's amplitude."""
BEGIN = 5000
"""The pump begins to weaken after so many cycles."""
PLAN = (
    Do(Follow(trajectories=(Sine(amplitude_mm=4.0, period_s=8.0, cycles=3),))),
    UntilDone(60.0),
    Do(DriveCurrent(i_x_A=2.0)),
    Pause(4.0),
    Do(DriveCurrent(pump_x_duty=1.0, pump_y_duty=1.0)),
    Pause(8.0),
)


@dataclass(frozen=True)
class Ageing:
    """Effects that grow with the cycles of a bench, and the share of flow lost at the end."""

    name: str
    effects: Mapping[str, Mapping[str, float]]
    flow_lost: float = 0.0


AGEINGS = (
    Ageing("nothing", {}),
    Ageing(
        "transformation_fatigue", {"transformation_fatigue": {"shift_K": 1.2e-3, "shrink": 1e-5}}
    ),
    Ageing("residual_elongation", {"residual_elongation": {"per_cycle_m": 2e-7}}),
    Ageing("a pump that weakens", {}, flow_lost=0.45),
)


def grown(ageing: Ageing, cycle: int, cycles: int, *, seed: int, folder: Path) -> Row:
    """Return the row of the standard run after so many cycles."""
    effects = {name: dict(values) for name, values in ageing.effects.items()}
    if ageing.flow_lost and cycle > BEGIN:
        share = ageing.flow_lost * (cycle - BEGIN) / (cycles - BEGIN)
        effects["flow_shortfall"] = {"share": share}
    driver = VirtualDriver(built_in("A").with_effects(effects), seed=seed, folder=folder)
    driver.cycles = (SHARE * cycle, SHARE * cycle)
    plan = Plan(f"standard-{cycle}", PLAN)
    driver.run(plan)
    row = row_of(log_path(folder, plan))
    log_path(folder, plan).unlink()
    assert row is not None
    return msgspec.structs.replace(row, unix_s=float(cycle), cycles=0.0)


def aged(
    ageing: Ageing, *, cycles: int, every: int, seed: int, limits: Mapping[str, float]
) -> Health:
    """Return the health of a bench over so many cycles."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            msgspec.structs.replace(
                grown(ageing, cycle, cycles, seed=seed, folder=Path(folder)),
                cycles=float(every if cycle else 0),
            )
            for cycle in range(0, cycles + 1, every)
        ]
    return health_of(rows, limits)


def lines(ageing: Ageing, healths: Sequence[Health]) -> str:
    """Return what was noticed on benches that age alike, in a line of Markdown."""
    series = sum(len(health.trends) for health in healths)
    told = [trend for health in healths for trend in health.changed]
    first = [
        min((float(t.x[t.noticed]) for t in h.changed if t.noticed is not None), default=None)
        for h in healths
    ]
    names = ", ".join(sorted({trend.name.partition(": ")[2] for trend in told}))
    shown = ", ".join("–" if cycle is None else f"{cycle:.0f}" for cycle in first)
    return f"| {ageing.name} | {series} | {len(told)} | {shown} | {names} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=20_000)
    parser.add_argument("--every", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print("| bench | series | that changed | first noticed at cycle, by seed | what |")
    print("|---|---:|---:|---|---|")
    for ageing in AGEINGS:
        healths = [
            aged(ageing, cycles=options.cycles, every=options.every, seed=seed, limits={})
            for seed in range(options.seeds)
        ]
        print(lines(ageing, healths), flush=True)


if __name__ == "__main__":
    main()
