"""Where runs start: where they read at their start, not where the bench was mounted.

What springs keep of the runs and strokes before is in no recording. Once they are cold, all
martensite, it is in what they read: their temperatures and the displacement. (What play, friction
and a drained tube keep is not.) Replayed from where it was mounted, a bench that lacks nothing
would leave many floors of such a run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.plant import ModelPoint, PlantModel, StartReading, Traits, traits_of
from smad.diagnosis.runs import GapRun
from smad.units import in_words


def usual_starts(plant: PlantModel, groups: Sequence[Sequence[GapRun]]) -> list[dict[str, float]]:
    """For each group of repeats the mean of each channel at their start.

    A channel is left out of all groups if one reads what no bench can start at: then the reading is
    off. A group without a reading gets the mean of the others.
    """
    out: list[dict[str, float]] = [{} for _ in groups]
    taken = {name: r for name, r in traits_of(plant).starts.items() if r.taken}
    for name, reading in taken.items():
        means = [_mean_start(group, name, reading) for group in groups]
        known = [mean for mean in means if mean is not None]
        if known and all(map(reading.possible, known)):
            for start, mean in zip(out, means, strict=True):
                start[name] = float(np.mean(known)) if mean is None else mean
    return out


def _mean_start(repeats: Sequence[GapRun], name: str, reading: StartReading) -> float | None:
    """Mean of a channel at the start of repeats; None where none has the readings."""
    needed = {name, reading.above} - {""}
    read = [run.undriven.at_start(needed) for run in repeats]
    found = [reading.counted(name, values) for values in read if needed <= values.keys()]
    return float(np.mean(found)) if found else None


def starting_as_read(plant: PlantModel, run: GapRun) -> GapRun:
    """The run, to be replayed from where it reads; one that says where it starts is kept."""
    (starts,) = usual_starts(plant, [[run]])
    return run if run.starts or not starts else replace(run, starts=starts, starts_read=True)


def unusable_starts(plant: PlantModel, run: GapRun) -> list[str]:
    """What a run reads at its start and no cold bench has, in words."""
    unit = {channel.name: in_words(channel.unit) for channel in plant.channels}
    out = []
    for name, reading in traits_of(plant).starts.items():
        value = _mean_start([run], name, reading) if reading.taken else None
        if value is not None and not reading.possible(value):
            above = f" above {reading.above}" if reading.above else ""
            out.append(
                f"{name} reads {value:.1f} {unit[name]}{above} at the start, as no cold bench "
                "does: the replay starts as mounted; let the springs cool before a recording"
            )
    return out


def corrected_starts(
    traits: Traits, reads: Mapping[str, float], at: Mapping[str, float], shown: Mapping[str, float]
) -> dict[str, float]:
    """Where a model stands that is to read `reads`, if it shows `shown` where it stands `at`.

    Its sensors add the difference.
    """
    return {
        name: at[name] + value - traits.starts[name].counted(name, shown)
        if traits.starts[name].taken
        else value
        for name, value in reads.items()
    }


def with_corrected_starts(plant: PlantModel, point: ModelPoint, played: Played) -> Played:
    """The run, started where the model at `point` stands when it reads what the run says."""
    reads = played.run.starts
    stood = played.with_fields(starts_read=False)
    if not reads:
        return stood
    (predicted,) = predictions(plant, point, [stood], exact=True)
    shown = {c.name: float(y) for c, y in zip(plant.channels, predicted[0], strict=True)}
    return stood.with_fields(starts=corrected_starts(traits_of(plant), reads, reads, shown))
