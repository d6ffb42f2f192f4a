"""The reference of a good bench, from the runs of good days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.constants import shipped
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.paired.good import GoodRuns, Repeats, good_runs, least_sd, on_one_grid
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses, responses
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, nominal_point
from smad.diagnosis.questions import CORRELATED, free_model, temper_of, tempered
from smad.diagnosis.rivals.changes import Changes, changes_at
from smad.diagnosis.rivals.evidence import Evidence, Trial
from smad.diagnosis.rivals.fit import fit_from_several, reference_at
from smad.diagnosis.runs import GapRun
from smad.progress import Say, silent


@dataclass(frozen=True, kw_only=True)
class Reference(GoodRuns):
    """Everything that a check-up needs of the good bench.

    `responses` are those of the plant's places, `changes` those of its effects, of each run.
    """

    responses: Responses
    changes: Changes

    def parameter_covariance(self, plant: PlantModel) -> Array:
        """How well the good runs say where the parameters are, (p, p), in prior deviations.

        What the model leaves of them counts as noise.
        """
        runs = self.runs
        off = [np.where(r.valid, r.mean - r.base, 0.0) for r in runs]
        rows = sum(r.valid.sum(axis=0) for r in runs)
        square = sum((x**2).sum(axis=0) for x in off) / np.maximum(rows, 1)
        sd = np.sqrt((square + least_sd(plant) ** 2) * CORRELATED)
        X = np.concatenate(
            [(np.where(r.valid, r.slopes, 0.0) / sd).reshape(len(r.slopes), -1) for r in runs],
            axis=1,
        )
        return np.asarray(np.linalg.inv(X @ X.T + np.eye(len(X))))


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    progress: Say = silent,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group.

    Raises PairingError when the runs of a group do not have the same inputs.
    """
    placed = with_places(plant)
    repeated = [on_one_grid(placed, group) for group in groups]
    progress("reference model")
    noise = estimate_floors([run for group in groups for run in group], placed, PERIOD_S)
    good = good_runs(placed, repeated, _fitted_point(placed, repeated), noise)
    played = [r.played for r in repeated]
    known = responses(placed, good.point, played, progress=progress)
    progress("what each effect changes")
    return Reference(
        runs=good.runs,
        point=good.point,
        floor=good.floor,
        repeats=good.repeats,
        responses=known,
        changes=changes_at(placed, good.point, played, placed.effects),
    )


def _fitted_point(plant: PlacesPlant, repeated: Sequence[Repeats]) -> ModelPoint:
    """The parameters that leave least of the means of good runs, fitted as those of any rival."""
    least = least_sd(plant)
    trials = []
    for r in repeated:
        mean, count = r.mean(r.values)
        rows = RunRows(
            sd=np.broadcast_to(least, mean.shape),
            valid=count > 0,
            day=np.zeros((0, *mean.shape)),
            day_sd=np.zeros(0),
            rho=np.zeros(len(least)),
        )
        trials.append(Trial(played=r.played, target=mean, rows=rows))
    evidence = Evidence(trials=tuple(trials))
    temper = temper_of(shipped(), free=True, channels=evidence.channels)
    model = tempered(free_model(plant, nominal_point(plant)), evidence, temper)
    nominal = reference_at(evidence, model, np.zeros(model.parameters))
    made = nominal and fit_from_several(evidence, nominal, np.full(evidence.channels, CORRELATED))
    return made.point if made else model.start
