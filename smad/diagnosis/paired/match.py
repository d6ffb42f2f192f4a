"""Which runs have the same inputs."""

from __future__ import annotations

from collections.abc import Sequence

from smad.diagnosis.data.rows import binned, edges_s, input_difference, offset_s
from smad.diagnosis.plant import PlantModel
from smad.diagnosis.runs import GapRun

_LIKE = 0.05
_ROW_S = 0.2
_LEAST_SHARE = 0.05


def same_programme(plant: PlantModel, run: GapRun, other: GapRun) -> bool:
    """Whether two runs have the same inputs over what both recorded.

    Where no input steps nothing says when a run begins; then those of one name are the same.
    """
    if not len(edges_s(run)) or not len(edges_s(other)):
        return run.name == other.name
    start = float(other.t_s[0] - other.dt_s)
    bins = max(1, int(other.duration_s / _ROW_S))
    first = binned(other, bins, plant, start)
    second = binned(run, bins, plant, start + offset_s(run, other))
    both = first.covered & second.covered
    if both.mean() < _LEAST_SHARE:
        return False
    off = input_difference(second, first)[both].max(axis=1)
    return bool(off.mean() < _LIKE)


def grouped(plant: PlantModel, runs: Sequence[GapRun]) -> list[list[GapRun]]:
    """The runs, those of the same inputs together."""
    groups: list[list[GapRun]] = []
    for run in runs:
        mine = next((g for g in groups if same_programme(plant, run, g[0])), None)
        if mine is None:
            groups.append([run])
        else:
            mine.append(run)
    return groups
