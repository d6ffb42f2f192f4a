"""Where runs start: where they read at their start, not where the bench was mounted.

What the springs keep of the runs and strokes before is left out of every recording. With nothing
missing, a replay from where it was mounted would leave 14 floors of such a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.plant import PlantModel, StartReading, traits_of
from smad.diagnosis.runs import GapRun


def usual_starts(plant: PlantModel, groups: Sequence[Sequence[GapRun]]) -> list[dict[str, float]]:
    """For each group of repeats the mean of each channel at their start.

    A channel is left out of all groups if one reads what no bench can start at: then the reading is
    off. A group without a reading gets the mean of the others.
    """
    out: list[dict[str, float]] = [{} for _ in groups]
    for name, reading in traits_of(plant).starts.items():
        means = [_mean_start(group, name, reading) for group in groups]
        known = [mean for mean in means if mean is not None]
        if known and reading.low < min(known) and max(known) < reading.high:
            for start, mean in zip(out, means, strict=True):
                start[name] = float(np.mean(known)) if mean is None else mean
    return out


def _mean_start(repeats: Sequence[GapRun], name: str, reading: StartReading) -> float | None:
    """Mean of a channel at the start of repeats; None where none has the readings."""
    needed = {name, reading.above} - {""}
    read = [run.at_start(needed) for run in repeats]
    found = [r[name] - r.get(reading.above, 0.0) for r in read if needed <= r.keys()]
    return float(np.mean(found)) if found else None


def started(plant: PlantModel, runs: Sequence[GapRun]) -> list[GapRun]:
    """The runs, each to be replayed from where it starts; one that says where is kept."""
    starts = usual_starts(plant, [[run] for run in runs])
    return [replace(run, starts=run.starts or s) for run, s in zip(runs, starts, strict=True)]
