"""The gap of new runs before and after an improved model, in the open loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.played import predictions
from smad.diagnosis.data.scales import row_length_s
from smad.diagnosis.errors import RunRefused
from smad.diagnosis.gap import Measured, rms
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint, PlantModel, nominal_point
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import SignalGap


def verified(plant: PlantModel, runs: Sequence[GapRun], model: ModelPoint) -> list[SignalGap]:
    """RMS of every channel with the nominal model (`raw`) and with `model` (`places`).

    The last is over all channels, in floors. Raises RunRefused when no run is admitted.
    """
    period_s = row_length_s(runs, plant)
    admission = admit(runs, plant, period_s)
    if not admission.admitted:
        raise RunRefused(
            "no run can be used",
            value="; ".join(f"{f.run}: {f.text}" for f in admission.findings if f.refuses),
            action="record runs that drive the bench, and give those",
        )
    floors = estimate_floors(admission.admitted, plant, period_s)
    measured = Measured.of(plant, admission.admitted, period_s)
    points = (nominal_point(plant), model)
    found = [predictions(with_places(plant), point, measured.played) for point in points]
    left = [[y - p for y, p in zip(measured.values, stage, strict=True)] for stage in found]
    before, after = (rms(x, measured.valid) for x in left)
    rows = []
    scaled = np.zeros((2, 0))
    for i, c in enumerate(plant.channels):
        if c.name in floors and any(v[:, i].any() for v in measured.valid):
            floor = floors[c.name]
            rows.append(_row(c.name, c.unit, floor, float(before[i]), float(after[i])))
            scaled = np.c_[scaled, [before[i] / floor, after[i] / floor]]
    together = np.sqrt((scaled**2).mean(axis=1))
    return [*rows, _row("all signals", "floors", 1.0, *map(float, together))]


def _row(signal: str, unit: str, floor: float, before: float, after: float) -> SignalGap:
    return SignalGap(
        signal=signal, unit=unit, floor=floor, raw=before, parameters=before, places=[after]
    )
