"""Whether a plant may be replayed in longer steps than its own, and with thinned samples.

What such a replay costs at one point is taken off; what it costs a change of the model is not. A
plant that is right at its own step only would be fitted wrongly without a word.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from smad.gap.data.noise import Floor
from smad.gap.data.replay import Dataset, Detail
from smad.gap.plant import Array, ModelPoint, PlantModel, nominal_point

_PACES = (1, 2)
_STEP = 0.2
_SHARE = 0.5
"""Of a change of the model, that coarser replays may get wrong."""
_LEAST = 1.0
"""Floors below which a change says nothing."""


def serving_replays(dataset: Callable[[int], Dataset], floors: Mapping[str, Floor]) -> int:
    """By how much the steps of coarser replays are divided so that they serve; 0 if none does.

    `dataset` makes a run's evidence with steps so divided. Half as long steps double the time of a
    diagnosis, replays in full detail throughout would take several times as long.
    """
    return next((n for n in _PACES if coarse_replays_serve(dataset(n), floors)), 0)


def coarse_replays_serve(dataset: Dataset, floors: Mapping[str, Floor]) -> bool:
    """Whether coarser replays change with the model as those in full detail do.

    Every parameter is moved, and every effect put as it typically is: what counts is the largest
    share of such a change that a coarser replay gets wrong, in floors, over all outputs. On
    nineteen benches of the withheld plant it was at most 0.43, of a friction that sticks and slips.
    In half as long steps it was 0.29 there.
    """
    plant = dataset.plant
    points = [nominal_point(plant), *_changes(plant)]
    floor = np.ones(dataset.n)
    for s in dataset.segments:
        floor[s.rows] = floors[s.channel].total
    fine, fast = (_scaled_changes(dataset, points, d, floor) for d in (Detail.FINE, Detail.FAST))
    seen = np.sqrt(np.mean(np.square(fine), axis=1)) > _LEAST
    if not seen.any():
        return True
    wrong = np.linalg.norm((fast - fine)[seen], axis=1) / np.linalg.norm(fine[seen], axis=1)
    return bool(np.max(wrong) <= _SHARE)


def _changes(plant: PlantModel) -> list[ModelPoint]:
    """Points beside the nominal one: a parameter moved, or an effect as it typically is."""
    theta = nominal_point(plant).theta
    moved = [
        ModelPoint({**theta, p.name: p.nominal + _STEP * p.prior_sd}) for p in plant.parameters
    ]
    return moved + [ModelPoint(theta, {e.name: e.at()}) for e in plant.effects]


def _scaled_changes(
    dataset: Dataset, points: list[ModelPoint], detail: Detail, floor: Array
) -> Array:
    """Changes from the first point, in floors; shape (points - 1, rows), 0 where a replay fails."""
    values = dataset.predict(points, detail=detail)
    change = dataset.change(values[1:], values[0], detail)
    return np.where(dataset.valid, change / floor, 0.0)
