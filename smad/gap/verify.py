"""The gap of new runs before and after an improved model, in the open loop."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

import msgspec
import numpy as np

from smad.gap.data.admission import admit
from smad.gap.data.noise import estimate_floors
from smad.gap.data.replay import Dataset
from smad.gap.data.views import open_views
from smad.gap.errors import RunRefused
from smad.gap.fit.judge import excess_by_key, shrink
from smad.gap.fit.lsq import Problem
from smad.gap.model.scales import suited
from smad.gap.model.whiten import OutputNoise, Whitening
from smad.gap.plant import ModelPoint, PlantModel, nominal_point, units
from smad.gap.runs import GapRun
from smad.gap.settings import Settings


class Verified(msgspec.Struct, frozen=True):
    """Excess gap of one channel over its floor; channel "all" is all together."""

    channel: str
    unit: str
    floor: float
    before: float
    after: float
    shrink: float


def verified(
    plant: PlantModel,
    runs: Sequence[GapRun],
    model: ModelPoint,
    settings: Settings | None = None,
    executor: Executor | None = None,
) -> list[Verified]:
    """Gap of every channel with the nominal model and with `model`, and of all.

    Raises RunRefused when no run is admitted.
    """
    settings = settings or suited(Settings(), runs, plant)
    admission = admit(runs, plant, settings)
    if not admission.admitted:
        raise RunRefused(
            "no run can be used",
            value="; ".join(f"{f.run}: {f.text}" for f in admission.findings if f.refuses),
            action="record runs that drive the bench, and give those",
        )
    floors = estimate_floors(admission.admitted, plant, settings)
    views = open_views(plant)
    ev = Dataset(plant, admission.admitted, views, settings, executor, fast=False)
    noise = {k: OutputNoise(floors[ev.rows_of(k)[0].channel].total) for k in ev.keys}
    problem = Problem(ev, Whitening(ev, noise), np.zeros(ev.n))
    predicted = ev.predict([nominal_point(plant), model])
    gaps = [excess_by_key(problem, np.square(problem.scaled(y))) for y in predicted]
    unit = units(plant)
    rows = []
    for key in ev.keys:
        channel = ev.rows_of(key)[0].channel
        before, after = (float(np.sqrt(g.get(key, 0.0))) for g in gaps)
        rows.append(
            Verified(channel, unit[channel], noise[key].sigma, before, after, shrink(after, before))
        )
    before, after = (float(np.sqrt(np.mean(list(g.values())))) for g in gaps)
    rows.append(Verified("all", "", 1.0, before, after, shrink(after, before)))
    return rows
