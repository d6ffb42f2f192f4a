"""Pairs: with what has changed in the simulator, nothing is left of a check-up."""

import numpy as np

from smad.checkup.commission import commissioned
from smad.checkup.programme import shipped
from smad.diagnosis.paired.difference import pair_runs
from smad.diagnosis.paired.good import least_sd
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.rivals.fit import replayed
from smad.diagnosis.rivals.rival import free_model

from .short import PLANT, played

RUN = shipped().runs[0]
MOVED = {"stress_start": 1.05, "stress_finish": 1.03, "flow_max": 0.97, "resistivity": 1.02}
"""Parameters with what they are multiplied by; displacement changes by millimetres."""
STEADY = dict.fromkeys(("tube_loss", "flow_max", "film_scale"), 1.0)
"""No day is like another in these, but here."""


def test_other_parameters_in_other_water_leave_nothing_once_they_are_in_the_simulator() -> None:
    reference = commissioned(PLANT, [[played(s, moved=STEADY, what=RUN) for s in (1, 2, 3)]])
    now = played(10, water_degC=24.0, moved=STEADY | MOVED, what=RUN)
    pairs = pair_runs(with_places(PLANT), reference, [(now, RUN.name)])
    (trial,) = pairs.evidence().trials
    model = free_model(pairs.plant, reference.point)
    theta = dict(reference.point.theta)
    for name, factor in MOVED.items():
        theta[name] = theta.get(name, PLANT.parameter_set[name]) * factor
    left = []
    for point in (reference.point, ModelPoint(theta, {})):
        predicted = replayed(pairs.evidence(), point, model, exact=True)
        assert predicted is not None
        rows = np.where(trial.rows.valid, trial.target - predicted[0], 0.0)
        left.append(np.sqrt((rows**2).mean(axis=0)) / least_sd(PLANT))
    before, after = left
    assert before.max() > 100.0
    assert after.max() < 3.0
