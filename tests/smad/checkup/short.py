"""A short programme on a simulated bench whose day and noise follow from a seed."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from evaluation.programme.segments import run_of
from smad.checkup.programme import ProgrammeRun
from smad.diagnosis.plant import EffectValues, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant

PLANT = SmaPlant(only=("rtd_lag", "driver_gain", "tube_friction", "force_offset"))
SHORT = run_of(
    "short",
    "heat and cool both sides",
    [(3.0, 0, 0, 0, 0), (3.0, 3.0, 0, 0, 0), (3.0, 0, 0, 0.8, 0), (2.0, 0, 0, 0, 0),
     (3.0, 0, 2.8, 0, 0), (4.0, 0, 0, 0, 0.6), (2.0, 1.5, 0, 0, 0), (4.0, 0, 0, 1, 1)],
)  # fmt: skip


def played(
    seed: int,
    effects: EffectValues | None = None,
    *,
    water_degC: float = 27.0,
    what: ProgrammeRun = SHORT,
    moved: Mapping[str, float] | None = None,
) -> GapRun:
    """A run on a simulated bench whose day and noise follow from the seed.

    `moved` are parameters with what they are multiplied by.
    """
    rng = np.random.default_rng(seed)
    run = what.as_run(water_degC, 27.0 + 0.3 * rng.normal())
    theta = {
        name: PLANT.parameter_set[name] * (1.0 + spread * rng.normal())
        for name, spread in (("tube_loss", 0.01), ("flow_max", 0.006), ("film_scale", 0.01))
    }
    theta |= {n: PLANT.parameter_set[n] * factor for n, factor in (moved or {}).items()}
    found = PLANT.simulate(ModelPoint(theta, effects or {}), run)
    shown = {
        c.name: found[c.name] + c.noise * rng.normal(size=len(run.t_s)) for c in PLANT.channels
    }
    return GapRun(what.name, run.t_s + rng.uniform(0.0, 5.0), run.inputs, shown)


def starting_at(run: GapRun, away_mm: float) -> GapRun:
    """The run as it would be if the bench had started so far away."""
    point, there = ModelPoint({}, {}), replace(run, starts={"displacement_mm": away_mm})
    here, elsewhere = PLANT.simulate(point, run), PLANT.simulate(point, there)
    return run.with_columns(outputs={n: y + elsewhere[n] - here[n] for n, y in run.outputs.items()})
