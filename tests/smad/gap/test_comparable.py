"""Models that are compared are replayed alike, and fits of many laws are not left half way."""

from __future__ import annotations

import numpy as np
import pytest
from smad.gap import Settings
from smad.gap.compare.select import Selection, Selector
from smad.gap.compare.tracks import follow_tracks
from smad.gap.compare.weigh import weigh
from smad.gap.fit import joint
from smad.gap.fit.descent import descent
from smad.gap.fit.judge import judge
from smad.gap.fit.lsq import FitResult, Problem, drive, fitting
from smad.gap.fit.stages import Prepared, prepare
from smad.gap.model.whiten import OutputNoise, Whitening

from smad.diagnosis.data.grid import Dataset, Detail
from smad.diagnosis.data.views import local_views
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.search.space import Space
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded as bench_recorded
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    good = bank(OTHER, seed=40)[:3]
    runs = bank(OTHER | {"c_J_K": 33.0}, {"coupling": SHOWN["coupling"]})
    return prepare(runs[:3], HeaterPlant(), SETTINGS, good=good, hold_out=runs[3:])


def test_tied_and_free_refit_share_one_calibration(prepared: Prepared) -> None:
    ev = prepared.problem.dataset
    assert prepared.tied is not None
    for fit in (prepared.tied, prepared.fit):
        assert ev.predict([fit.point])[0] == pytest.approx(fit.predicted, abs=1e-9)


def test_runs_held_out_are_judged_in_full_detail(prepared: Prepared) -> None:
    assert prepared.hold is not None
    (judged,) = judge([prepared.fit], prepared.hold)
    fine = prepared.hold.dataset.predict([prepared.fit.point], detail=Detail.FINE)[0]
    assert np.array_equal(judged.held, fine)


def test_what_the_parameters_had_left_undone_is_no_effects_gain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    quiet = prepare(bank(OTHER)[:3], HeaterPlant(), SETTINGS, good=bank(OTHER, seed=40)[:3])
    assert quiet.tied is not None
    ended = quiet.tied
    aside = ended.p + np.where(np.arange(ended.space.size) < 3, 0.6, 0.0)
    half = fitting(quiet.problem, ended.space, aside, theta_A=ended.A, iterations=-3)
    refit = drive([half])[0]
    assert refit.objective > ended.objective + 50.0

    def answer() -> Selection:
        return Selector(refit, None, EFFECTS).run()

    assert answer().best.names == ()
    monkeypatch.setattr(Selector, "_on_equal_terms", lambda self, b, chosen, c: (b, c))
    assert answer().best.names != ()


def _bench_fit() -> FitResult:
    plant = SmaPlant(only=("rtd_lag",))
    point = ModelPoint({}, {"rtd_lag": {"tau_s": 0.4}})
    runs = [bench_recorded("mixed", plant, point, seed, duration_s=20.0) for seed in (1, 2)]
    ev = Dataset(plant, runs, local_views(plant), Settings(), None)
    noise = {k: OutputNoise(0.05) for k in ev.keys}
    problem = Problem(ev, Whitening(ev, noise), np.zeros(ev.n))
    space = Space(tuple(plant.parameters[:2]))
    return drive([fitting(problem, space, space.start(), iterations=1)])[0]


def test_what_a_coarse_step_costs_a_model_is_learnt_at_that_model() -> None:
    fit = _bench_fit()
    ev = fit.problem.dataset
    error = ev.coarse_error(fit.point, fit.predicted)
    fine = ev.predict([fit.point], detail=Detail.FINE)[0]
    assert np.max(np.abs(error)) > 0.0
    assert fit.predicted + error == pytest.approx(fine, abs=1e-9)


def test_known_good_runs_that_do_not_hold_leave_the_free_refit_without_an_effect() -> None:
    moved = bank(OTHER | {"c_J_K": 34.0, "ha_W_K": 0.66})
    other = prepare(moved, HeaterPlant(), SETTINGS, good=bank(OTHER, seed=40)[:3])
    track = follow_tracks(other, EFFECTS)
    assert not track.tied
    assert track.selection.best.names == ()
    assert track.selection.screened
    assert weigh(other, track).effects == ()


def test_a_descent_from_far_comes_to_where_a_fit_from_near_comes(prepared: Prepared) -> None:
    problem = prepared.problem
    space = Space(tuple(HeaterPlant().parameters))
    lo, hi = space.bounds()
    aside = np.random.default_rng(3).normal(0.0, 0.5, space.size)
    far = np.clip(space.start() + aside, lo, hi)
    near = drive([fitting(problem, space, space.start(), refresh_theta=True, squares=True)])[0]
    (end,) = drive([descent(problem, space, far, rounds=6)])
    assert problem.misfit(end.z) <= 1.02 * problem.misfit(near.z)
    assert np.all(end.p >= lo)
    assert np.all(end.p <= hi)


def test_an_interval_ends_where_the_profile_does_if_straight_lines_run_into_a_bound(
    prepared: Prepared, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert prepared.tied is not None
    cause = next(e for e in EFFECTS if e.name == "coupling")
    start = joint.Start((cause,), {cause.name: SHOWN["coupling"]})
    (found,) = joint.joint_fits(prepared.tied, [start]).values()
    i = found.fit.space.n_theta
    bound = found.fit.space.bounds()[0][i]
    (usual,) = joint.intervals(found, seed=0)
    draws = joint.bootstrap(found.fit, 50, seed=0)
    draws[:, i] = np.where(np.arange(50) < 10, bound, draws[:, i])
    monkeypatch.setattr(joint, "bootstrap", lambda *args: draws)
    (wild,) = joint.intervals(found, seed=0)
    assert found.fit.space.value(i, bound) < wild.low <= wild.value
    assert wild.high >= wild.value
    assert usual.low > found.fit.space.value(i, bound)
