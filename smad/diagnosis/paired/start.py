"""Where runs start: good ones elsewhere than the bench was mounted, others elsewhere than those.

A bench with a trouble need not come back to where a good one does: what its springs keep of the
runs and strokes before is left out of every recording. If a run starts further from the good one
than noise and days explain, starting there is one more direction in which days differ. One standard
deviation of it is the distance measured, so that a rival which changes the reading instead of the
start is not ruled out. Unlike other directions it has no form error: heat takes it away, so that a
large one would hide for a whole run what lasts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, traits_of
from smad.diagnosis.runs import GapRun

_START_S = 1.0
_ELSEWHERE = 3.0
"""Standard deviations from which a start counts as another."""


def distances(plant: PlantModel, change: Array, rows: RunRows, period_s: float) -> dict[str, float]:
    """By channel how far from the good run a run starts, where that is further than days explain.

    `change` (bins, channels) is now − then, less what the model carries over.
    """
    out = {}
    first = slice(max(round(_START_S / period_s), 1))
    names = [channel.name for channel in plant.channels]
    for name in traits_of(plant).starts:
        c = names.index(name)
        seen = rows.valid[first, c]
        if not seen.any():
            continue
        away = float(change[first, c][seen].mean())
        noise = float(rows.sd[first, c][seen].mean())
        days = rows.day_sd * rows.day[:, first, c][:, seen].mean(axis=1)
        if abs(away) > _ELSEWHERE * np.hypot(noise, np.linalg.norm(days)):
            out[name] = away
    return out


def usual_start(plant: PlantModel, repeats: Sequence[GapRun]) -> dict[str, float]:
    """By channel where good repeats of a run start on average, if that is not where the plant does.

    After strokes that bring a bench to the same rest each time this is elsewhere than it was
    mounted.
    """
    out = {}
    for name, (least, most) in traits_of(plant).starts.items():
        found = [start[name] for run in repeats if (start := run.at_start([name]))]
        if found and least < abs(mean := float(np.mean(found))) < most:
            out[name] = mean
    return out


def directions(
    plant: PlantModel,
    point: ModelPoint,
    again: Played,
    predicted: Array,
    away: Mapping[str, float],
) -> Array:
    """What starting so far `away` by channel does to a run, (directions, bins, channels).

    `predicted` is the prediction of `again`. A start that the model cannot run from is left out.
    """
    usual = again.run.starts
    starts = [
        again.starting({**usual, name: usual.get(name, 0.0) + distance})
        for name, distance in away.items()
    ]
    moved = np.array(predictions(plant, point, starts, exact=True)).reshape(-1, *predicted.shape)
    return np.asarray(moved - predicted)[np.isfinite(moved).all(axis=(1, 2))]
