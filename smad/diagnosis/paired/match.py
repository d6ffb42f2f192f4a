"""Which runs have the same inputs."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.rows import binned, edges_s, input_difference, offset_s
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun

_LIKE = 0.05
"""Mean difference of two runs with the same inputs, as a share of an input's travel."""
_LEAST_MOVE = 0.1
"""Least travel of an input, as a share of its range: less may be noise."""
_LEAST_SHARE = 0.05
"""Least share of a run that both must have recorded."""

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
    # Constant inputs do not identify a programme.
    return bool((stepped or moves.max() > _LEAST_MOVE) and off.max(axis=1).mean() < _LIKE)


def grouped(runs: Sequence[Run], same: Callable[[Run, Run], bool]) -> list[list[Run]]:
    """The runs in groups, each `same` as the first of its group."""
    groups: list[list[Run]] = []
    for run in runs:
        group = next((g for g in groups if same(run, g[0])), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return groups
