"""Which runs have the same inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.rows import binned, edges_s, input_difference, offset_s
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun

_LIKE = 0.05
"""Of what an input moves, that two runs may differ by on average."""
_LEAST_MOVE = 0.1
"""Of an input's range, that counts as what it moves at least: less may be noise."""
_LEAST_SHARE = 0.05
"""Of a run, that the other must have recorded as well: of less their inputs say nothing."""

Run = TypeVar("Run")


def same_programme(
    plant: PlantModel, run: GapRun, other: GapRun, period_s: float = PERIOD_S
) -> bool:
    """Whether two runs have the same inputs over what both recorded, in rows of `period_s`.

    Where no input steps, runs begin together, or have the same name.
    """
    stepped = len(edges_s(run)) and len(edges_s(other))
    if not stepped and run.name == other.name:
        return True
    start_s = other.begins_s
    bins = max(1, int(other.duration_s / period_s))
    first = binned(other, bins, plant, start_s, period_s)
    second = binned(run, bins, plant, start_s + offset_s(run, other), period_s)
    both = first.covered & second.covered
    if both.mean() < _LEAST_SHARE:
        return False
    moves = np.maximum(*(np.ptp(b.inputs[both], axis=0) for b in (first, second)))
    off = input_difference(second, first)[both] / np.maximum(moves, _LEAST_MOVE)
    # Inputs that stay where they are tell no programme from another.
    return bool((stepped or moves.max() > _LEAST_MOVE) and off.max(axis=1).mean() < _LIKE)


def grouped(runs: Sequence[Run], same: Callable[[Run, Run], bool]) -> list[list[Run]]:
    """The runs, those together that are the `same` as the first of their group."""
    groups: list[list[Run]] = []
    for run in runs:
        group = next((g for g in groups if same(run, g[0])), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return groups
