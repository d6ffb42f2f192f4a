"""The gap of new runs before and after an improved model, in the open loop."""

from __future__ import annotations

from collections.abc import Sequence

from smad.diagnosis.budget import budget_of
from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.grid import row_length_s
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.played import predictions
from smad.diagnosis.errors import RunRefused
from smad.diagnosis.gap import Measured
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
    m = Measured.of(plant, admission.admitted, period_s)
    before, after = (
        [y - p for y, p in zip(m.values, predictions(with_places(plant), x, m.played), strict=True)]
        for x in (nominal_point(plant), model)
    )
    stages, channels = (before, before, after), plant.channels
    return budget_of(channels, stages, m.valid, [floors] * len(m.played)).rows
