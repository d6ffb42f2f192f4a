"""Replays in long steps, as the diagnosis makes by the thousand, stay near those in short ones."""

from collections.abc import Mapping

import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant import kernel as k
from sim_device.plant.effects.registry import EFFECTS
from tests.sim_device.plant.cases import alternating, setup_of

P = load_parameters("A")
LONG_S, SHORT_S = 0.15, 0.002
INPUTS = alternating(step_s=LONG_S, amps=2.9)
SHOWN = ("rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N")
LAWS = [e for e in EFFECTS if e.law]


def worst(effects: Mapping[str, Mapping[str, float]], outputs: tuple[str, ...]) -> float:
    """RMS of what long steps change, as a share of an output's excursion; the largest."""
    long, short = (
        simulate(P, INPUTS, effects=effects, outputs=outputs, dt_s=dt) for dt in (LONG_S, SHORT_S)
    )
    return max(
        float(np.sqrt(np.mean(np.square(long[name] - short[name]))) / np.ptp(short[name]))
        for name in outputs
    )


@pytest.mark.parametrize("capacity_ratio", [1e-5, 2e-4, 3e-3, 0.05])
def test_a_wall_that_stores_hardly_any_heat_does_not_run_away(capacity_ratio: float) -> None:
    wall = {"capacity_ratio": capacity_ratio, "conductance_W_mK": 1.0}
    assert worst({"tube_wall": wall}, SHOWN) < 0.05


def test_a_wall_of_hardly_any_capacity_is_as_good_as_none() -> None:
    wall = {"tube_wall": {"capacity_ratio": 1e-5, "conductance_W_mK": 1.0}}
    with_wall, without = (
        simulate(P, INPUTS, effects=e, outputs=("rtd_x_degC",), dt_s=LONG_S) for e in (wall, {})
    )
    assert with_wall["rtd_x_degC"] == pytest.approx(without["rtd_x_degC"], abs=0.01)


@pytest.mark.parametrize("pieces", [2, 10, 40])
@pytest.mark.parametrize("dead_s", [0.0, 0.333])
def test_a_pump_brings_the_same_water_in_steps_of_any_length(pieces: int, dead_s: float) -> None:
    slow = {"pump_lag": {"dead_s": dead_s, "spinup_s": 2.0}}
    n = len(INPUTS.t_s) - 1
    t_s = np.linspace(0.0, INPUTS.t_s[-1], n * pieces + 1)
    each = np.r_[0, np.repeat(np.arange(1, n + 1), pieces)]
    often = Inputs(t_s, INPUTS.i_A[each], INPUTS.pump_duty[each])
    coarse, fine = (
        simulate(P, inputs, effects=slow, outputs=("flow_x_m3_s",), dt_s=1.0)["flow_x_m3_s"][1:]
        for inputs in (INPUTS, often)
    )
    assert coarse.max() > 0.0
    assert fine.reshape(n, pieces).mean(axis=1) == pytest.approx(coarse, abs=1e-3 * coarse.max())


@pytest.mark.parametrize("seed", range(12))
def test_with_any_law_temperatures_hardly_depend_on_the_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    effects = {
        e.name: {
            q.name: float(np.clip(q.typical * 10 ** rng.uniform(-4.0, 0.5), q.low, q.high))
            for q in e.parameters
            if not q.switch
        }
        for e in LAWS
    }
    assert worst(effects, ("rtd_x_degC", "rtd_y_degC")) < 0.1, effects


def test_the_film_of_what_has_run_away_is_read_within_the_table() -> None:
    setup = setup_of(P)
    p, table = setup.p, setup.table
    T = 1e30
    conductivity, rise = table[-1, 0], table[-1, 1]
    root = 0.60 + rise * T ** (1 / 6) * p.sqrt_D_h
    expected = conductivity * p.per_D_h * root**2 * p.film_perimeter
    assert setup.film_W_per_m_K(T, 300.0, 0.0) == pytest.approx(expected, rel=1e-9)
    assert np.isnan(setup.film_W_per_m_K(float("nan"), 300.0, 0.5))


def test_a_curve_is_read_within_its_table_wherever_the_progress_is() -> None:
    curve, out = np.ones(k.CURVE_SIZE), np.zeros(2)
    k.outer_curve(curve, float("nan"), out)
    assert np.isnan(out[0])
    k.outer_curve(curve, k.PROGRESS_HIGH, out)
    assert out[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "effects",
    [
        {"unified_kinetics": {"on": 1.0, "tails": 0.3}},
        {
            "unified_kinetics": {"on": 1.0, "tails": 0.3},
            "cooling_front": {"share": 0.9, "place": 0.5},
            "pump_lag": {"dead_s": 0.0, "spinup_s": 0.4},
        },
    ],
    ids=["lumped", "cells"],
)
def test_half_the_step_leaves_much_less_than_half_of_its_error(effects) -> None:
    inputs = alternating(step_s=0.1, amps=2.9)
    shown = ("rtd_x_degC", "displacement_m")
    long, half, fine = (
        simulate(P, inputs, effects=effects, outputs=shown, dt_s=dt) for dt in (0.1, 0.05, 0.005)
    )
    for name in shown:
        off, off_half = (np.sqrt(np.mean(np.square(o[name] - fine[name]))) for o in (long, half))
        assert off_half < 0.4 * off, name


@pytest.mark.parametrize("tau_s", [0.05, 1.0])
def test_an_rtd_that_lags_shows_the_same_in_steps_of_any_length(tau_s: float) -> None:
    often = alternating(step_s=0.01, amps=2.9)
    out = simulate(P, often, effects={"rtd_lag": {"tau_s": tau_s}}, outputs=SHOWN)
    shown = out["rtd_x_degC"]
    every = slice(None, None, 10)
    n = len(often.t_s[every])
    means = [
        np.vstack([a[:1], a[1 : 1 + 10 * (n - 1)].reshape(n - 1, 10, 2).mean(axis=1)])
        for a in (np.asarray(often.i_A), np.asarray(often.pump_duty))
    ]
    seldom = Inputs(often.t_s[every], *means)
    long = simulate(P, seldom, effects={"rtd_lag": {"tau_s": tau_s}}, outputs=SHOWN)["rtd_x_degC"]
    assert np.sqrt(np.mean(np.square(long - shown[every]))) < 0.03


def test_a_latent_heat_that_falls_with_stress_is_not_negative_in_a_slack_spring() -> None:
    drive = alternating(seconds=30.0, amps=2.9)
    held = Inputs(drive.t_s, drive.i_A, drive.pump_duty, stage_m=np.zeros(drive.t_s.size))
    steep = {"stress_latent": {"slope": 3.0}}
    long, short = (
        simulate(P, held, effects=steep, fixture="stretch", outputs=("rtd_x_degC",), dt_s=dt)
        for dt in (0.01, 0.001)
    )
    assert long["rtd_x_degC"] == pytest.approx(short["rtd_x_degC"], abs=0.1)


def test_a_spring_that_has_lost_all_its_recoverable_strain_loses_no_more() -> None:
    drive = alternating(seconds=960.0, amps=4.0, step_s=0.05)
    worn = {"transformation_fatigue": {"shift_K": 0.0, "shrink": 0.05}}
    run = simulate(P, drive, effects=worn, outputs=("displacement_m",), dt_s=0.05)
    early, later, last = (
        float(np.ptp(run["displacement_m"][(drive.t_s >= t) & (drive.t_s < t + 160.0)]))
        for t in (0.0, 640.0, 800.0)
    )
    assert later < 0.7 * early
    assert last == pytest.approx(later, rel=1e-3)
