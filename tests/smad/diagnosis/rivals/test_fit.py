"""The end of a fit: exact replays alone say whether a step leads down."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.plant import Array, ModelPoint, nominal_point
from smad.diagnosis.rivals.convergence import polished
from smad.diagnosis.rivals.evidence import Evidence, Trial, recorded_evidence
from smad.diagnosis.rivals.fit import (
    Fit,
    Reference,
    leave_out,
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


def test_the_coordinates_that_judge_a_run_are_those_of_the_other_runs() -> None:
    rows = RunRows.of(np.ones(1), np.ones((50, 1), dtype=bool))
    trials = [
        Trial(played=cast(Any, SimpleNamespace()), target=np.full((50, 1), level), rows=rows)
        for level in (3.0, -1.0, -1.0, -1.0)
    ]
    evidence = Evidence(trials=tuple(trials))
    # A level that is fitted to all of them is 0.
    model = SimpleNamespace(
        bounds=(np.full(1, -9.0), np.full(1, 9.0)), prior=(np.zeros(1), np.full((1, 1), 1e-9))
    )
    residual = evidence.residual([np.zeros((50, 1))] * 4)
    of_all = SimpleNamespace(
        model=model, x=np.zeros(1), residual=residual, slopes=np.ones((1, len(residual)))
    )
    without_each = np.concatenate(leave_out(evidence, cast(Any, of_all)))
    assert without_each == pytest.approx([-1.0, 1 / 3, 1 / 3, 1 / 3], abs=0.01)
