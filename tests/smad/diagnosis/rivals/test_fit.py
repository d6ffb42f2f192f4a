"""The end of a fit: exact replays alone say whether a step leads down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.plant import Array, ModelPoint, nominal_point
from smad.diagnosis.rivals.convergence import polished
from smad.diagnosis.rivals.evidence import Evidence, recorded_evidence
from smad.diagnosis.rivals.fit import (
    Fit,
    Reference,
    objective,
    reference_at,
    replayed,
    weights,
)
from smad.diagnosis.rivals.rival import free_model
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded

PLANT = SmaPlant()
MOVED = {"stress_start": 1.04, "austenite_finish": 1.01, "film_scale": 1.05, "resistivity": 1.02}


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    nominal = nominal_point(PLANT)
    bench = ModelPoint({n: PLANT.parameter_set[n] * f for n, f in MOVED.items()}, {})
    run = recorded("levels", PLANT, bench, 5, duration_s=24.0)
    return recorded_evidence(PLANT, [run], estimate_floors([run], PLANT, 0.2), 0.2, nominal)


def by_replay(evidence: Evidence, reference: Reference, x: Array) -> float:
    """F of exact replays."""
    model = reference.model
    predicted = replayed(evidence, model.point(x), model, exact=True)
    assert predicted is not None
    rows = evidence.residual(predicted)
    rows = evidence.less_drifts(rows, weights(evidence, rows))
    return objective(evidence, model, x, rows)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fit_that_has_ended_is_lower_by_exact_replays_and_says_how_low(
    evidence: Evidence, seed: int
) -> None:
    model = free_model(PLANT, nominal_point(PLANT))
    start = np.random.default_rng(seed).normal(size=model.parameters) * 0.3
    here = reference_at(evidence, model, start)
    assert here is not None
    begun = Fit(
        model=model,
        x=start,
        residual=evidence.residual(here.exact),
        slopes=here.slopes.astype(np.float32),
        linearized_at=here.linearized_at,
        objective=np.inf,
        shift=here.shift,
    )
    made = polished(evidence, begun)
    again = polished(evidence, replace(made, objective=np.inf))
    assert made.shift is None
    assert made.objective == pytest.approx(by_replay(evidence, here, made.x), rel=1e-3)
    assert made.objective < 0.8 * by_replay(evidence, here, start)
    assert again.objective <= made.objective
