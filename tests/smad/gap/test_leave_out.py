"""Runs predicted by models that were fitted to the others only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smad.gap import Settings
from smad.gap.fit.leave_out import left_out
from smad.gap.fit.lsq import FitResult, Problem, drive, fitting, objective
from smad.gap.model.whiten import OutputNoise, Whitening

from smad.diagnosis.data.grid import Dataset
from smad.diagnosis.data.views import open_views
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.space import Space
from tests.smad.gap.cases import bank
from tests.smad.gap.heater_plant import PARAMETERS, HeaterPlant

SPACE = Space(PARAMETERS)
KNOWN_SCALE = Settings(cell_dof=1e9)


def problem_of(runs: list[GapRun], settings: Settings | None = None) -> Problem:
    plant = HeaterPlant()
    ev = Dataset(plant, runs, open_views(plant), settings or Settings())
    noise = {k: OutputNoise(0.05) for k in ev.keys}
    return Problem(ev, Whitening(ev, noise), np.zeros(ev.n))


def fitted(problem: Problem) -> FitResult:
    start = SPACE.start()
    steps = fitting(problem, SPACE, start, iterations=12, refresh_theta=True, tolerance=1e-3)
    return drive([steps])[0]


@pytest.fixture(scope="module")
def runs() -> list[GapRun]:
    return bank({"c_J_K": 32.0, "ha_W_K": 0.57, "t_a_degC": 22.6}, {"coupling": {"g_W_K": 0.05}})


def test_a_run_is_predicted_as_a_refit_to_the_others_predicts_it(runs: list[GapRun]) -> None:
    fit = fitted(problem_of(runs, KNOWN_SCALE))
    found = left_out(fit)
    for k in range(len(runs)):
        theirs = fitted(problem_of(runs[:k] + runs[k + 1 :], KNOWN_SCALE)).point
        refitted = fit.problem.dataset.predict([theirs], runs=[k])[0]
        rows = np.concatenate([np.arange(s.start, s.stop) for s in fit.problem.dataset.segments
                               if s.run == k])  # fmt: skip
        moved = np.abs(refitted - fit.predicted)[rows].max()
        assert moved > 0
        assert np.abs(refitted - found.predicted)[rows].max() < 0.3 * moved


def test_a_run_is_predicted_at_the_point_that_is_given_for_it(runs: list[GapRun]) -> None:
    fit = fitted(problem_of(runs))
    found = left_out(fit)
    ev = fit.problem.dataset
    for k, point in enumerate(found.points):
        own = ev.predict([point], runs=[k])[0]
        for s in ev.segments:
            if s.run == k:
                assert found.predicted[s.rows] == pytest.approx(own[s.rows])


@pytest.mark.parametrize("wrong", [-1.0, 0.02])
def test_a_step_that_harms_the_runs_it_is_fitted_to_is_not_taken(
    runs: list[GapRun], wrong: float
) -> None:
    """Sensitivities of the wrong sign, or so small that every step is far too long."""
    fit = fitted(problem_of(runs))
    misled = replace(fit, A=(wrong * fit.A).astype(np.float32))
    for k, point in enumerate(left_out(misled).points):
        others = problem_of(runs[:k] + runs[k + 1 :])
        p = np.array([(point.theta[q.name] - q.nominal) / q.prior_sd for q in PARAMETERS])

        def loss(at: np.ndarray, others: Problem = others) -> float:
            z = others.white(others.dataset.predict([SPACE.point(at)])[0])
            return objective(others, SPACE, at, z)

        assert loss(p) <= loss(fit.p) + 1e-6


def test_a_single_run_keeps_the_point_of_its_fit(runs: list[GapRun]) -> None:
    fit = fitted(problem_of(runs[:1]))
    found = left_out(fit)
    assert found.points == (fit.point,)
    assert found.predicted == pytest.approx(fit.predicted)
