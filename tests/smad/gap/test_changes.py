"""What has changed since the known-good runs: tied parameters, old laws, rough replays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smad.gap import Settings, diagnose
from smad.gap.fit.discrepancy import fed_noise
from smad.gap.fit.lsq import Problem, drive, fitting, sensitivities
from smad.gap.model.whiten import OutputNoise, Whitening
from smad.gap.records import Outcome

from sim_device.plant.parameters import initial_detwinned
from smad.diagnosis.data.grid import Dataset, Detail, Grid, thinned
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.views import local_views
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.space import Space
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded as sma_recorded
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, ask, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant, recorded

NOMINAL = {p.name: p.nominal for p in HeaterPlant().parameters}
OLD_LAG = {"sensor_lag": {"tau_s": 0.6}}


def _good(effects: dict[str, dict[str, float]] | None = None) -> list[GapRun]:
    return bank(OTHER, effects, seed=40)[:3]


def test_what_the_good_runs_show_too_is_no_change() -> None:
    verdict = ask(bank(OTHER, OLD_LAG), good=_good(OLD_LAG)).verdict
    assert verdict.outcome is Outcome.NO_GAP, verdict.text
    assert verdict.effects == []


def test_what_has_come_since_is_named_beside_what_was_there() -> None:
    both = OLD_LAG | {"driver_gain": SHOWN["driver_gain"]}
    diagnosis = ask(bank(OTHER, both), good=_good(OLD_LAG))
    assert diagnosis.verdict.outcome is Outcome.EFFECT, diagnosis.verdict.text
    assert diagnosis.verdict.effects == ["driver_gain"]
    (gain,) = diagnosis.values
    # Another form of the law would say another number; the data alone leave far less open.
    assert gain.value - gain.low == pytest.approx(SETTINGS.form_share * gain.value, rel=0.1)


def test_a_change_of_the_parameters_since_the_good_runs_is_called_one() -> None:
    moved = OTHER | {"c_J_K": 34.0, "ha_W_K": 0.66}
    verdict = ask(bank(moved), good=_good()).verdict
    assert verdict.outcome is Outcome.PARAMETERS, verdict.text


def test_the_verdict_can_be_asked_for_once_more_without_its_cause() -> None:
    runs = bank(OTHER, {"coupling": SHOWN["coupling"]})
    diagnosis = diagnose(runs, plant=HeaterPlant(), settings=SETTINGS, leave_out=True)
    (left,) = diagnosis.left_out
    assert diagnosis.verdict.effects == ["coupling"]
    assert (left.effect, left.outcome, left.names) == ("coupling", Outcome.UNKNOWN, [])
    assert diagnose(runs, plant=HeaterPlant(), settings=SETTINGS).left_out == []


def _bench_run() -> GapRun:
    return sma_recorded("mixed", SmaPlant(), ModelPoint({}), 1, duration_s=30.0)


def test_a_thinned_run_has_the_same_bins_and_the_same_means() -> None:
    run = _bench_run()
    keep = np.r_[0:311, 330 : len(run.t_s)]
    torn = GapRun(
        run.name,
        run.t_s[keep],
        {k: v[keep] for k, v in run.inputs.items()},
        {k: v[keep] for k, v in run.outputs.items()},
    )
    grid = Grid.of(torn, 0.1)
    thin, coarse = thinned(torn, grid, 2, 0.1)
    assert len(thin.t_s) == pytest.approx(len(torn.t_s) / 5, rel=0.02)
    assert np.array_equal(coarse.t_s, grid.t_s)
    for name, column in torn.outputs.items():
        assert coarse.mean(thin.outputs[name]) == pytest.approx(grid.mean(column), abs=1e-9)


def test_a_run_sampled_no_finer_than_the_grid_is_not_thinned() -> None:
    run = recorded("random", 3, duration_s=20.0)
    grid = Grid.of(run, run.dt_s)
    assert thinned(run, grid, 2, run.dt_s)[0] is run


class _Failing(HeaterPlant):
    """Cannot be simulated where the heat capacity is above its nominal value."""

    def simulate(self, point, run, views, *, fast=False):  # type: ignore[no-untyped-def]
        out = super().simulate(point, run, views, fast=fast)
        if point.theta["c_J_K"] > NOMINAL["c_J_K"] + 1e-9:
            return {k: np.full_like(v, np.nan) for k, v in out.items()}
        return out


def _problem(plant: HeaterPlant, run: GapRun) -> Problem:
    ev = Dataset(plant, [run], local_views(plant), Settings())
    noise = {k: OutputNoise(0.05) for k in ev.keys}
    return Problem(ev, Whitening(ev, noise), np.zeros(ev.n))


def _lossy(run: GapRun) -> GapRun:
    valid = np.ones(len(run.t_s), dtype=bool)
    valid[80:120] = False
    return replace(run, valid=valid)


def test_a_run_that_could_not_be_simulated_is_seen_despite_lost_samples() -> None:
    run = _lossy(recorded("random", 3, duration_s=20.0))
    problem = _problem(_Failing(), run)
    ev = problem.dataset
    good, bad = ev.predict(
        [ModelPoint(NOMINAL), ModelPoint(NOMINAL | {"c_J_K": 1.1 * NOMINAL["c_J_K"]})]
    )
    assert not ev.failed(good, 0)
    assert ev.failed(bad, 0)
    assert not np.any(ev.change(bad[None, :], good))


def test_a_slope_at_the_edge_of_what_can_be_simulated_is_that_on_the_inside() -> None:
    run = recorded("random", 3, duration_s=20.0)
    space = Space(tuple(HeaterPlant().parameters))
    column = [p.name for p in space.theta].index("c_J_K")

    def slope(plant: HeaterPlant) -> np.ndarray:
        problem = _problem(plant, run)
        steps = sensitivities(problem, space, np.zeros(space.size), [column])
        ask_points = next(steps)
        try:
            while True:
                ask_points = steps.send(
                    problem.dataset.predict(ask_points.points, detail=ask_points.detail)
                )
        except StopIteration as end:
            return np.asarray(end.value[:, 0], dtype=np.float64)

    free, edge = slope(HeaterPlant()), slope(_Failing())
    assert np.linalg.norm(edge) > 0.5 * np.linalg.norm(free)
    assert edge @ free / np.linalg.norm(edge) / np.linalg.norm(free) > 0.99


def test_rough_slopes_point_where_detailed_ones_do() -> None:
    """Most to a few per cent; one that a switch of the hysteresis decides, to a half."""
    plant, run = SmaPlant(), _bench_run()
    ev = Dataset(plant, [run], local_views(plant), Settings())
    floors = estimate_floors([run], plant, Settings())
    nominal = {p.name: p.nominal for p in plant.parameters}
    whitening = Whitening(ev, fed_noise(ev, floors, ModelPoint(nominal), 0))
    moved = [nominal | {p.name: p.nominal + 0.2 * p.prior_sd} for p in plant.parameters]
    points = [ModelPoint(theta) for theta in (nominal, *moved)]
    fine, rough = (ev.predict(points, detail=d) for d in (Detail.FINE, Detail.ROUGH))
    off = []
    for a, b in zip(fine[1:] - fine[0], rough[1:] - rough[0], strict=True):
        size = float(np.linalg.norm(whitening.scale(a)))
        if size > 1.0:
            off.append(float(np.linalg.norm(whitening.scale(b - a))) / size)
    assert len(off) > 20
    assert np.median(off) < 0.1
    assert max(off) < 0.6


def test_a_preload_that_cannot_be_mounted_is_moved_to_the_nearest_that_can() -> None:
    plant = SmaPlant()
    low = {"initial_force": 0.4 * plant.parameter_set["initial_force"]}
    assert 0.0 <= initial_detwinned(plant.set_of(low)) <= 1.0
    kept = {"initial_force": 1.01 * plant.parameter_set["initial_force"]}
    assert plant.set_of(kept)["initial_force"] == kept["initial_force"]


def test_a_tie_holds_parameters_that_the_runs_alone_would_move() -> None:
    run = recorded("random", 3, {"c_J_K": 33.0}, duration_s=30.0)
    problem = _problem(HeaterPlant(), run)
    theta = tuple(HeaterPlant().parameters)

    def moved(tie: np.ndarray | None) -> float:
        space = Space(theta, (), NOMINAL, {}, tie)
        fit = drive([fitting(problem, space, space.start(), iterations=6)])[0]
        return float(np.max(np.abs(fit.p)))

    assert moved(None) > 0.5
    assert moved(np.eye(len(theta)) * 1e8) < 0.05


def test_the_library_of_the_tiny_plant_has_the_effects_these_tests_name() -> None:
    assert {"sensor_lag", "driver_gain", "coupling"} <= {e.name for e in EFFECTS}
