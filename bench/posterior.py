"""How often a diagnosis' posterior holds what is true, where the form of the model is right.

`python -m bench.posterior` draws benches of our own kernel around set A, records three runs of
each through its sensors, refits, and compares each value with what was put in, in standard
deviations of the posterior that `randomise="posterior"` draws from.
"""

from __future__ import annotations

from collections.abc import Iterator

import click
import numpy as np
import numpy.typing as npt

from sim_device.plant.errors import PlantError
from smad.diagnosis import diagnose
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded

Array = npt.NDArray[np.float64]
FAMILIES, RUN_S = ("pulses", "levels", "stairs"), 50.0
SPREAD = 0.5
"""Of the benches, in standard deviations of the prior."""
MEASURED = ("water_temperature", "ambient_temperature")
"""What each run's own sensors give a replay; every bench has that of set A."""


def off(number: int) -> dict[str, float]:
    """Of each parameter of a bench: estimate less truth, in posterior standard deviations."""
    plant, rng = SmaPlant(), np.random.default_rng([number, 146])
    strengths = [
        q
        for q in plant.parameters
        if q.name in plant.parameter_set.names and q.name not in MEASURED
    ]
    while True:
        values = {
            q.name: float(
                np.clip(q.nominal + SPREAD * q.prior_sd * rng.standard_normal(), q.low, q.high)
            )
            for q in strengths
        }
        try:
            runs = [
                recorded(
                    family, plant, ModelPoint(values), 10 * number + run_number, duration_s=RUN_S
                )
                for run_number, family in enumerate(FAMILIES)
            ]
        except PlantError:
            # No pair can be built of these.
            continue
        break
    fitted = diagnose(runs, plant=plant).verdict.parameters
    truth = {q.name: values.get(q.name, q.before) for q in fitted}
    return {q.name: (q.after - truth[q.name]) / max(q.sd, 1e-12) for q in fitted}


def lines(errors: dict[str, Array]) -> Iterator[str]:
    """A line a parameter, then all together."""
    whole = np.concatenate(list(errors.values()))
    yield f"{'parameter':24}{'rms':>8}{'in ±1.96':>10}"
    for name, z in (*errors.items(), ("all", whole)):
        yield f"{name:24}{np.sqrt(np.mean(z**2)):8.2f}{np.mean(np.abs(z) < 1.96):10.2f}"
    yield f"all: median of |z| {np.median(np.abs(whole)):.2f}; of a normal distribution 0.67"


@click.command()
@click.option("--benches", default=8, show_default=True)
def main(benches: int) -> None:
    """Print how far estimates are from what was put in, in standard deviations."""
    each = []
    for number in range(benches):
        each.append(off(number))
        print(
            f"bench {number}: rms {np.sqrt(np.mean(np.square(list(each[-1].values())))):.2f}",
            flush=True,
        )
    for line in lines({name: np.array([z[name] for z in each]) for name in each[0]}):
        print(line)


if __name__ == "__main__":
    main()
