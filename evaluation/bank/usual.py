"""The usual size of an effect: what leaves about three repeat floors on a bench as published."""

import numpy as np

from evaluation.bank.any_inputs import OTHER_DAY, commands_of
from evaluation.bank.making import raised, rms_difference
from evaluation.bank.recorder import Run, record, record_program
from evaluation.plant.effects import BY_NAME, Active
from evaluation.plant.parameters import Bench

FLOORS = 3.0
ROUNDS = 4
SEEDS = {"open_loop": 1, "steps": 2, "sines": 3}


def usual(name: str) -> tuple[float, float]:
    """The magnitude of an effect near three floors, and the floors that it leaves."""
    bench = Bench()

    def runs(active: tuple[Active, ...]) -> list[Run]:
        return [record(bench, active, f, seed, seconds=50.0) for f, seed in SEEDS.items()]

    def again(recorded: list[Run], day: int = 0) -> list[Run]:
        seeds = SEEDS.values()
        return [
            record_program(bench, (), commands_of(r), seed + day)
            for r, seed in zip(recorded, seeds, strict=True)
        ]

    quiet = runs(())
    floor = rms_difference(quiet, again(quiet, OTHER_DAY))
    active: tuple[Active, ...] = (Active(name, BY_NAME[name].usual),)
    best = (0.0, np.inf)
    for _ in range(ROUNDS):
        now = runs(active)
        gap = rms_difference(now, again(now)) / floor
        candidate = (active[0].magnitude, float(gap.max()))
        best = min(best, candidate, key=lambda b: abs(np.log(max(b[1], 1e-3) / FLOORS)))
        active = raised(active, gap, FLOORS)
    return best
