"""The numerical parts, each against an oracle or a property that it must have."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear
from smad.gap import Settings
from smad.gap.compare.residual_tests import ar_coefficients, cross_correlation, ljung_box
from smad.gap.fit.lsq import Problem, drive, fitting, solve_box
from smad.gap.model.flexible import Designs, fit_correction
from smad.gap.model.whiten import OutputNoise, Whitening, arma_innovations
from statsmodels.regression.linear_model import yule_walker
from statsmodels.stats.diagnostic import acorr_ljungbox

from smad.diagnosis.data.grid import Dataset, Grid
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.views import local_views, open_views
from smad.diagnosis.plant import Channel, ModelPoint, Signal
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.space import Space
from tests.smad.gap.cases import OTHER, bank
from tests.smad.gap.heater_plant import NOMINAL, PARAMETERS, HeaterPlant, recorded


def test_the_box_solver_agrees_with_scipy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        A, b = rng.standard_normal((12, 6)), rng.standard_normal(12)
        lo, hi = -rng.random(6) * 0.5, rng.random(6) * 0.5
        ours = solve_box(A.T @ A, A.T @ b, lo, hi)
        assert ours == pytest.approx(lsq_linear(A, b, (lo, hi), tol=1e-12).x, abs=1e-5)


def test_a_fit_ends_where_scipys_least_squares_ends() -> None:
    """In the limit of a known scale the objective is ordinary least squares with a prior."""
    runs = bank({"c_J_K": 32.0, "ha_W_K": 0.57, "t_a_degC": 22.6})[:2]
    settings = Settings(cell_dof=1e9)
    plant = HeaterPlant()
    ev = Dataset(plant, runs, open_views(plant), settings)
    noise = {k: OutputNoise(0.5) for k in ev.keys}
    problem = Problem(ev, Whitening(ev, noise), np.zeros(ev.n))
    space = Space(PARAMETERS)
    ours = drive([fitting(problem, space, space.start(), iterations=12, refresh_theta=True)])[0]

    def residual(p):  # type: ignore[no-untyped-def]
        return np.r_[problem.white(ev.predict([space.point(p)])[0]), p]

    theirs = least_squares(residual, space.start(), bounds=space.bounds(), diff_step=1e-2)
    assert ours.p == pytest.approx(theirs.x, abs=0.02)


def test_innovations_of_noise_plus_drift_are_white_with_unit_variance() -> None:
    rng = np.random.default_rng(1)
    run = recorded("random", 1, duration_s=3000.0)
    plant = HeaterPlant()
    ev = Dataset(plant, [run], open_views(plant), Settings())
    n, sigma, k, tau = len(run.t_s), 0.3, 0.8, 2.0
    rho = float(np.exp(-0.1 / tau))
    drift = np.zeros(n)
    for i in range(1, n):
        drift[i] = rho * drift[i - 1] + np.sqrt(1 - rho**2) * rng.standard_normal()
    y = sigma * rng.standard_normal(n) + k * drift
    noise = {key: OutputNoise(sigma, {"": k}, tau) for key in ev.keys}
    z = Whitening(ev, noise).white(np.tile(y, len(ev.keys)))[:n]
    assert np.var(z) == pytest.approx(1.0, abs=0.05)
    assert ljung_box(z)[1] > 0.001
    assert ljung_box(y)[1] < 1e-6


@pytest.mark.parametrize(("share", "rho"), [(0.0, 0.9), (0.5, 0.9), (0.99, 0.99), (1.0, 0.7)])
def test_the_innovations_filter_has_the_autocovariance_it_factors(share: float, rho: float) -> None:
    theta, v = arma_innovations(share, rho)
    assert abs(theta) < 1.0
    gamma0 = share * (1 - rho**2) + (1 - share) * (1 + rho**2)
    assert v * (1 + theta**2) == pytest.approx(gamma0)
    assert v * theta == pytest.approx(rho * (1 - share), abs=1e-12)


def test_ljung_box_agrees_with_statsmodels() -> None:
    x = np.random.default_rng(2).standard_normal(400).cumsum()
    for data in (x, np.diff(x)):
        table = acorr_ljungbox(data, lags=[20])
        q, p = ljung_box(data, 20)
        assert q == pytest.approx(float(table["lb_stat"].iloc[0]))
        assert p == pytest.approx(float(table["lb_pvalue"].iloc[0]), abs=1e-9)


def test_autoregression_agrees_with_statsmodels() -> None:
    rng = np.random.default_rng(3)
    x = np.zeros(2000)
    for i in range(2, 2000):
        x[i] = 1.2 * x[i - 1] - 0.5 * x[i - 2] + rng.standard_normal()
    ours = ar_coefficients(x, 2)
    assert ours == pytest.approx(yule_walker(x, 2, method="mle")[0], abs=1e-6)


def test_prewhitening_keeps_a_coloured_driver_from_feigning_a_correlation() -> None:
    rng = np.random.default_rng(4)
    driver, other = (np.cumsum(rng.standard_normal(1500)) for _ in range(2))
    assert cross_correlation(driver, other)[1] > 0.01
    delayed = np.r_[np.zeros(5), driver[:-5]] + 0.1 * rng.standard_normal(1500)
    r, p = cross_correlation(driver, delayed)
    assert p < 1e-6
    assert r > 0.5


def test_the_floor_at_rest_is_the_sensors_noise_after_averaging() -> None:
    runs = [recorded("random", s, OTHER) for s in range(6)]
    floors = estimate_floors(runs, HeaterPlant(), Settings(period_s=0.1))
    for c in HeaterPlant().channels:
        assert floors[c.name].sigma == pytest.approx(
            np.hypot(c.noise, c.quantum / 12**0.5), rel=0.2
        )
        assert floors[c.name].source == "rest"


@pytest.mark.parametrize("rows_a_turn", [5.0, 400.0], ids=["a few rows a turn", "smooth"])
def test_where_nothing_rests_motion_within_a_few_rows_is_no_noise(rows_a_turn: float) -> None:
    t = np.arange(4000) * 0.1
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(t))
    y = np.sin(2 * np.pi * np.arange(len(t)) / rows_a_turn) + noise
    run = GapRun("turning", t, {"u": np.sin(t)}, {"y": y})
    plant: Any = SimpleNamespace(
        channels=(Channel("y", "1", 1e-4, -2.0, 2.0, "all", 0.1),),
        inputs=(Signal("u", "1", -1.0, 1.0),),
        regimes=lambda run, side: {"rest": np.zeros(len(run.t_s), dtype=bool)},
    )
    floor = estimate_floors([run], plant, Settings(period_s=0.1))["y"]
    assert floor.source == "differences"
    assert floor.sigma == pytest.approx(0.02, rel=0.15)


def test_bins_ignore_lost_samples_and_drop_out_when_most_are_lost() -> None:
    run = recorded("random", 1, duration_s=20.0)
    valid = np.ones(len(run.t_s), dtype=bool)
    valid[50:60] = False
    spoilt = run.with_columns(outputs={"rod_um": np.where(valid, run.outputs["rod_um"], 1e9)})
    grid = Grid.of(type(run)(**{**spoilt.__dict__, "valid": valid}), 0.5)
    assert np.max(grid.mean(spoilt.outputs["rod_um"])) < 1e4
    assert (~grid.valid).sum() == 2


def test_a_flexible_correction_predicts_runs_it_was_not_fitted_to() -> None:
    """An error that depends on state is found on runs left out; noise is not."""
    runs, plant = bank(), HeaterPlant()
    ev = Dataset(plant, runs, local_views(plant), Settings())
    predicted = ev.predict([ModelPoint(NOMINAL)])[0]
    residual = ev.residual(predicted)
    made, scale = Designs.of(ev), np.ones(ev.n)
    key = "thermal:l"
    assert fit_correction(made, residual, scale, key)[0].explained < 0.05
    rows = np.concatenate([np.arange(s.start, s.stop) for s in ev.rows_of(key)])
    warm = np.maximum(ev.measured[rows] - 22.0, 0.0)
    residual[rows] += 0.02 * warm**1.3
    correction, left_out = fit_correction(made, residual, scale, key)
    assert correction.explained > 0.8
    assert np.std(residual[rows] - left_out[rows]) < 0.4 * np.std(residual[rows])


def test_a_flexible_correction_of_one_run_predicts_stretches_that_it_was_not_fitted_to() -> None:
    ev = Dataset(HeaterPlant(), [recorded("sines", 1, duration_s=200.0)],
                  local_views(HeaterPlant()), Settings())  # fmt: skip
    residual, key = ev.residual(ev.predict([ModelPoint(NOMINAL)])[0]), "thermal:l"
    made, scale, (rows,) = Designs.of(ev), np.ones(ev.n), [s.rows for s in ev.rows_of(key)]
    assert fit_correction(made, residual, scale, key)[0].explained < 0.05
    residual[rows] += 0.02 * np.maximum(ev.measured[rows] - 22.0, 0.0) ** 1.3
    correction, left_out = fit_correction(made, residual, scale, key)
    assert correction.explained > 0.8
    assert np.std(residual[rows] - left_out[rows]) < 0.4 * np.std(residual[rows])


@pytest.mark.parametrize("rows", [1, 2, 9, 16, 27])
def test_a_series_shorter_than_the_lags_is_tested_on_those_it_has(rows: int) -> None:
    rng = np.random.default_rng(rows)
    q, p = ljung_box(rng.normal(size=rows))
    assert np.isfinite(q)
    assert 0.0 <= p <= 1.0
    r, p = cross_correlation(rng.normal(size=rows), rng.normal(size=rows))
    assert -1.0 <= r <= 1.0
    assert 0.0 <= p <= 1.0
