"""Runs that start elsewhere than their good run.

A bench with a trouble need not come back to where a good one does. If a run starts further from
the good one than noise and days explain, starting there is one more direction in which days differ.
One standard deviation of it is the distance measured, so that a rival which changes the reading
instead of the start is not ruled out. Unlike other directions it has no form error: heat takes it
away, so that a large one would hide for a whole run what lasts.
"""

from collections.abc import Mapping

import numpy as np

from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, traits_of

_START_S = 1.0
"""What counts as the start of a run, as in `GapRun.at_start`."""
_ELSEWHERE = 3.0
"""Standard deviations of noise and days from which a start counts as another: 1 in 370 by chance.
"""


def distances(
    plant: PlantModel, usual: Mapping[str, float], change: Array, rows: RunRows, period_s: float
) -> dict[str, float]:
    """By channel how far from the good run a run starts, where that is further than days explain.

    `usual` is where the good run starts, `change` (bins, channels) is now − then, less what the
    model carries over. More than a bench can start at is left out: then the reading is off.
    """
    out = {}
    first = slice(max(round(_START_S / period_s), 1))
    names = [channel.name for channel in plant.channels]
    for name, start in usual.items():
        reading = traits_of(plant).starts[name]
        c = names.index(name)
        seen = rows.valid[first, c]
        if not seen.any():
            continue
        away = float(change[first, c][seen].mean())
        noise = float(rows.sd[first, c][seen].mean())
        days = rows.day_sd * rows.day[:, first, c][:, seen].mean(axis=1)
        further = abs(away) > _ELSEWHERE * np.hypot(noise, np.linalg.norm(days))
        if further and reading.possible(start + away):
            out[name] = away
    return out


def directions(
    plant: PlantModel, point: ModelPoint, again: Played, predicted: Array, away: Mapping[str, float]
) -> Array:
    """What starting so far `away` by channel does to a run, (directions, bins, channels).

    `predicted` is the prediction of `again`. It is 0 where the model cannot start.
    """
    usual = again.run.starts
    starts = [
        again.with_fields(starts={**usual, name: usual[name] + distance})
        for name, distance in away.items()
    ]
    moved = np.array(predictions(plant, point, starts, exact=True)).reshape(-1, *predicted.shape)
    return np.where(np.isfinite(moved).all(axis=(1, 2), keepdims=True), moved - predicted, 0.0)
