"""Where runs start, if not as the bench was mounted: where they read at their start.

What the springs keep of the runs and strokes before is left out of every recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.plant import PlantModel, traits_of
from smad.diagnosis.runs import GapRun


def usual_starts(plant: PlantModel, groups: Sequence[Sequence[GapRun]]) -> list[dict[str, float]]:
    """For each group of repeats the mean of each channel at their start.

    A channel is left out of all groups if its means are small enough for a parameter such as the
    encoder's zero, which all runs share; and if one group reads more than a bench can start at,
    since then the reading is off.
    """
    out: list[dict[str, float]] = [{} for _ in groups]
    for name, (least, most) in traits_of(plant).starts.items():
        read = [[v for r in group for v in r.at_start([name]).values()] for group in groups]
        means = [float(np.mean(values)) if values else None for values in read]
        known = [mean for mean in means if mean is not None]
        if not least < max(map(abs, known), default=0.0) < most:
            continue
        for start, mean in zip(out, means, strict=True):
            start[name] = float(np.mean(known)) if mean is None else mean
    return out


def started(plant: PlantModel, runs: Sequence[GapRun]) -> list[GapRun]:
    """The runs, each to be replayed from where it starts; one that says where is kept."""
    starts = usual_starts(plant, [[run] for run in runs])
    return [replace(run, starts=run.starts or s) for run, s in zip(runs, starts, strict=True)]
