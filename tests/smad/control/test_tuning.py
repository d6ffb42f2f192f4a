"""Tuning: the rule and its margins, models from samples, refusals, and the shipped gains."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_device.plant import ParameterSet, load_parameters
from sim_device.plant.models import Model, built_in
from smad.config import Config, ControlConfig
from smad.control.tuning.errors import TuningError
from smad.control.tuning.identify import cooled, pulled, stillness
from smad.control.tuning.rules import NOISE_A, Gains, Lag, band_mm, gains_for, margins_of
from smad.experiments.tuning import Session, tune
from smad.experiments.virtual import VirtualDriver

T_S = 0.01 * np.arange(400)
CURRENT_A = np.where((T_S % 0.8) < 0.4, 3.0, 2.0)


def test_the_rule_is_the_published_one_until_noise_forbids_it() -> None:
    model = Lag(2.0, 0.8, 0.01, 2.5, 1.0)
    assert gains_for(model, 0.0, 0.2) == Gains(25.0, 31.0)
    assert gains_for(model, 0.02, 0.2) == Gains(10.0, 12.0)


def test_at_twice_the_current_a_lag_has_twice_the_gain() -> None:
    assert Lag(2.0, 0.8, 0.01, 2.0, 1.0).scaled_to(4.0) == Lag(4.0, 0.8, 0.01, 4.0, 1.0)


def test_the_margins_are_those_of_an_integrator_with_delay() -> None:
    # A proportional loop on an integrator crosses over at kp·gain; the delay takes its phase.
    model = Lag(2.0, 1e6, 0.01, 2.5, 1.0)
    margins = margins_of(model, Gains(25.0, 0.0))
    assert margins.gain == pytest.approx(math.pi / 2.0 / (50.0 * 0.01), rel=1e-3)
    assert margins.phase_deg == pytest.approx(90.0 - math.degrees(0.5), abs=0.1)
    assert margins.delay_s == pytest.approx((math.pi / 2.0 - 0.5) / 50.0, rel=1e-3)


def test_the_band_grows_with_the_count_and_with_the_noise() -> None:
    assert band_mm(0.001, 0.006, 0.01, 0.1) == pytest.approx(0.010)
    assert band_mm(0.010, 0.0, 0.01, 0.1) == pytest.approx(0.020)


def answer_to(current_A: np.ndarray, gain: float, lag_s: float, late: int) -> np.ndarray:
    """A lag with delay that answers the squared current, by Euler steps."""
    out, level = [], 0.0
    for k in range(current_A.size):
        power = current_A[max(0, k - late)] ** 2
        level += 0.01 * (gain * power - level / lag_s)
        out.append(level)
    return np.array(out)


@pytest.mark.parametrize(("lag_s", "late"), [(0.4, 3), (0.8, 10), (1.6, 2)])
def test_a_model_is_recovered_from_its_pulses(lag_s: float, late: int) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.002, T_S.size)
    seen = answer_to(CURRENT_A, 0.4, lag_s, late) + noise
    model = pulled(T_S, seen, CURRENT_A, CURRENT_A, "spring x")
    assert model.gain == pytest.approx(0.4 * 2.0 * model.at_A, rel=0.1)
    assert model.delay_s == pytest.approx(0.01 * late, abs=0.015)
    assert model.lag_s == pytest.approx(lag_s, rel=0.51)


def test_a_current_that_is_held_back_refuses() -> None:
    with pytest.raises(TuningError, match="saturated"):
        pulled(T_S, answer_to(CURRENT_A, 0.4, 0.8, 2), 0.8 * CURRENT_A, CURRENT_A, "spring x")


def test_what_does_not_follow_the_current_refuses() -> None:
    shaken = np.random.default_rng(1).normal(0.0, 0.01, T_S.size)
    with pytest.raises(TuningError, match="does not follow the current"):
        pulled(T_S, shaken, CURRENT_A, CURRENT_A, "spring x")


@pytest.mark.parametrize(
    ("values", "why"), [(0.05 * T_S, "drifts"), (np.full(T_S.size, math.nan), "no reading")]
)
def test_a_sensor_that_drifts_or_is_not_there_refuses(values: np.ndarray, why: str) -> None:
    with pytest.raises(TuningError, match=why):
        stillness(T_S, values, "displacement (mm)", 0.02)


def test_water_that_does_not_cool_refuses() -> None:
    warm = np.full(T_S.size, 40.0)
    with pytest.raises(TuningError, match="does not cool"):
        cooled(T_S, warm, np.full(T_S.size, 27.0), "spring x")
    falling = 27.0 + 13.0 * np.exp(-T_S / 2.0)
    assert cooled(T_S, falling, np.full(T_S.size, 27.0), "spring x").time_s == pytest.approx(
        2.0, rel=0.05
    )


def tuned_bench(parameters: ParameterSet, *, trial: bool = False) -> Session:
    config = Config()
    driver = VirtualDriver(Model(parameters), config=config)
    return tune(driver, config.control, None, trial=trial)


def test_the_shipped_gains_are_what_tuning_the_shipped_plant_gives() -> None:
    tuned = tuned_bench(load_parameters("A")).tuned
    shipped = ControlConfig()
    # The experiment begins where the present gains bring it, which moves the second digit.
    assert tuned.after.kp == pytest.approx(shipped.kp_A_per_mm, rel=0.05)
    assert tuned.after.ki == pytest.approx(shipped.ki_A_per_mm_s, rel=0.05)
    assert tuned.band_mm == shipped.hold.band_mm
    assert tuned.margins_after.gain > 1.9
    assert tuned.margins_after.phase_deg > 40.0
    for model in tuned.models.values():
        assert model.fit > 0.98


def test_a_bench_that_is_a_third_off_is_tuned_and_tried() -> None:
    a = load_parameters("A")
    off = a.replace(resistivity=0.7 * a["resistivity"], flow_max=0.7 * a["flow_max"])
    session = tuned_bench(off, trial=True)
    assert session.tuned.after.kp > 1.1 * session.tuned.before.kp
    assert session.trials is not None
    before, after = session.trials
    assert after.r2 >= before.r2
    assert "kp_A_per_mm" in session.tuned.toml()


def test_a_bench_without_encoder_or_too_weak_to_move_refuses() -> None:
    config = Config()
    blind = VirtualDriver(built_in("A"), lacking=frozenset({"displacement_mm"}))
    with pytest.raises(TuningError, match="displacement_mm"):
        tune(blind, config.control, None, trial=False)
    # Half an ampere warms the water, and moves nothing.
    weak = Config(control=ControlConfig(current_limit_A=0.5))
    with pytest.raises(TuningError, match="did not come to where the pulses begin"):
        tune(VirtualDriver(built_in("A"), config=weak), weak.control, None, trial=False)


def test_the_temperature_loop_is_tuned_likewise() -> None:
    config = Config()
    driver = VirtualDriver(built_in("A"), config=config)
    session = tune(driver, config.control, "y", trial=True)
    assert session.trials is not None
    before, after = session.trials
    assert after.settling_s < before.settling_s
    assert after.overshoot_K < 0.5
    assert after.ripple_mA < 1.2e3 * NOISE_A["temperature"]
    assert "[control.temperature]" in session.tuned.toml()
