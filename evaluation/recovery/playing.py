"""The runs of a case: a simulated bench in virtual time, with its controller, sensors and noise."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_device.plant import Drive
from sim_device.plant.models import Model
from smad.checkup.programme import shipped
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.spring_pair.signals import read_gap_run
from smad.experiments.driver import log_path
from smad.experiments.virtual import VirtualDriver

FIT = ("pulses", "levels", "sines", "stairs")
HELD_OUT = ("mixed", "quick levels")
"""Experiments of the catalogue that everyday runs are made of."""
REPEATS = 3
RUNS = 4
"""Of the shipped programme, its quick part first: what a check-up plays, and how often it was good.
"""
_SEED_STEP = 1000


@dataclass(frozen=True)
class Bench:
    """A simulated bench: the values of its parameters, and of the effects at work."""

    plant: SmaPlant
    theta: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]]

    @property
    def point(self) -> ModelPoint:
        """It as a point of the model."""
        return ModelPoint(self.theta, self.effects)

    def everyday(self, names: Sequence[str], seed: int, *, word: str = "") -> list[GapRun]:
        """Runs of the catalogue, each with a seed of its own."""
        runs = [
            recorded(n, self.plant, self.point, seed + k, past=_past(seed + k))
            for k, n in enumerate(names)
        ]
        return [replace(r, name=f"{word}{r.name}") for r in runs]

    def programme(self, seed: int, count: int = RUNS) -> list[GapRun]:
        """The first runs of the shipped programme, by their names."""
        runs = []
        for k, run in enumerate(shipped().runs[:count]):
            with tempfile.TemporaryDirectory() as folder:
                bench = Model(self.plant.set_of(self.theta)).with_effects(
                    self.plant.within(self.effects)
                )
                own_seed = seed + _SEED_STEP * k
                driver = VirtualDriver(
                    bench, seed=own_seed, folder=Path(folder), past=_past(own_seed)
                )
                plan = run.plan()
                driver.run(plan)
                runs.append(replace(read_gap_run(log_path(Path(folder), plan)), name=run.name))
        return runs


def _past(seed: int) -> list[tuple[float, Drive]]:
    """Seconds and drives before a run, in no log: one to three strokes of a spring and a rest."""
    rng = np.random.default_rng([seed, 5])
    held: list[tuple[float, Drive]] = []
    for _ in range(rng.integers(1, 4)):
        x = float(rng.integers(2))
        heat, cool = Drive(i_A=(4.0 * x, 4.0 * (1.0 - x))), Drive(pump_duty=(x, 1.0 - x))
        held += [(float(rng.uniform(2.0, 5.5)), heat), (2.0, Drive()), (16.0, cool), (3.0, Drive())]
    return [*held, (float(rng.uniform(10.0, 60.0)), Drive())]
