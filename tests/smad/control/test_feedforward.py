"""The inverse of the model: its times against the plant, and what it is good for."""

from __future__ import annotations

import math

import pytest

from sim_device.bench import SimulatedBench
from sim_device.plant import Drive, Plant, load_parameters
from smad.config import ControlConfig, CoolingConfig, FeedforwardConfig
from smad.control.commands import Follow, Sine, Tune
from smad.control.controller import Controller
from smad.control.feedforward import LONGEST_LEAD_S, Advice, Anticipation, SpringHeat
from smad.control.metrics import tracking_r2
from smad.control.plan import Do, Plan, UntilDone
from smad.control.runner import run_virtual

from .helpers import sample

MODEL = FeedforwardConfig()
DT_S = 0.01


def blocked_plant() -> Plant:
    """A spring between fixed ends, without the stress of a partner's motion."""
    return Plant(load_parameters("A"), fixture="blocked")


def spring_degC(plant: Plant) -> float:
    return plant.truth.T_K[0] - 273.15


def time_until(plant: Plant, drive: Drive, target_degC: float, *, rising: bool) -> float:
    for k in range(5000):
        if (spring_degC(plant) >= target_degC) if rising else (spring_degC(plant) <= target_degC):
            return k * DT_S
        plant.advance(drive, DT_S)
    raise AssertionError("never got there")


@pytest.mark.parametrize("target_degC", [30.0, 32.0, 34.0])
def test_the_time_to_heat_is_that_of_the_plant(target_degC: float) -> None:
    plant = blocked_plant()
    predicted = SpringHeat(MODEL, spring_degC(plant)).time_to_heat(
        spring_degC(plant), target_degC, 4.0
    )
    actual = time_until(plant, Drive(i_A=(4.0, 0.0)), target_degC, rising=True)
    assert predicted == pytest.approx(actual, rel=0.15, abs=0.03)


@pytest.mark.parametrize("target_degC", [45.0, 40.0, 36.0])
def test_the_time_to_cool_is_that_of_the_plant(target_degC: float) -> None:
    plant = blocked_plant()
    heat = SpringHeat(MODEL, spring_degC(plant))
    while spring_degC(plant) < 55.0:
        plant.advance(Drive(i_A=(4.0, 0.0)), DT_S)
        heat.update(spring_degC(plant), 26.85, 0.0, False, DT_S)
    predicted = heat.time_to_cool(spring_degC(plant), target_degC, 26.85)
    actual = time_until(plant, Drive(pump_duty=(1.0, 0.0)), target_degC, rising=False)
    assert predicted == pytest.approx(actual, rel=0.3, abs=0.3)


def test_the_estimate_of_the_water_follows_the_plant_through_draining_and_refilling() -> None:
    plant = blocked_plant()
    heat = SpringHeat(MODEL, spring_degC(plant))
    for drive in (
        Drive(i_A=(3.0, 0.0), drain=(True, False)),
        Drive(pump_duty=(1.0, 0.0)),
        Drive(i_A=(4.0, 0.0)),
    ):
        for _ in range(300):
            plant.advance(drive, DT_S)
            heat.update(spring_degC(plant), 26.85, drive.pump_duty[0], drive.drain[0], DT_S)
        assert heat.fill == pytest.approx(plant.truth.fill[0], abs=0.05)
        assert heat.water_degC + 273.15 == pytest.approx(plant.truth.T_water_K[0], abs=2.5)


def test_nothing_takes_time_where_nothing_has_to_change() -> None:
    heat = SpringHeat(MODEL, 40.0)
    assert heat.time_to_heat(40.0, 39.0, 4.0) == 0.0
    assert heat.time_to_cool(40.0, 41.0, 26.85) == 0.0
    assert heat.time_to_heat(40.0, 90.0, 0.0) == LONGEST_LEAD_S


def test_a_reversal_is_advised_before_the_reference_asks_for_it() -> None:
    def reference(lead_s: float) -> float:
        return 0.002 - 0.004 * max(0.0, lead_s - 0.3)

    # X is hot and pulls; Y is cold and needs about half a second to become ready.
    here = sample(1, displacement_m=0.002, rtd_degC=(42.0, 30.0, 26.85, 26.85), force_N=1.4)
    anticipation = Anticipation(MODEL, 4.0)
    advice = anticipation.step(reference, here, (False, False), DT_S)
    assert advice.direction == -1
    assert advice.push
    assert 0.3 < advice.lead_s < LONGEST_LEAD_S


def test_a_reference_that_goes_on_is_not_turned() -> None:
    here = sample(1, displacement_m=0.002, rtd_degC=(42.0, 30.0, 26.85, 26.85), force_N=1.4)
    advice = Anticipation(MODEL, 4.0).step(
        lambda lead: 0.0025 + 0.001 * lead, here, (False, False), DT_S
    )
    assert advice.direction == 1


@pytest.mark.parametrize("missed", [0, 5])
def test_a_temperature_that_is_not_read_once_leaves_the_advice_as_it_was(missed: int) -> None:
    def advised(gap: bool) -> list[Advice]:
        anticipation = Anticipation(MODEL, 4.0)
        read = (42.0, 26.85, 26.85, 26.85)
        return [
            anticipation.step(
                lambda lead: -0.001,
                sample(k, rtd_degC=(42.0, math.nan, *read[2:]) if gap and k == missed else read),
                (False, False),
                DT_S,
            )
            for k in range(10)
        ]

    assert advised(True) == advised(False)
    assert advised(True)[-1].lead_s > 0.1


def test_with_a_lower_limit_of_current_a_reversal_begins_earlier() -> None:
    def begins_at(limit_A: float) -> int:
        controller = Controller(ControlConfig(feedforward=FeedforwardConfig(enabled=True)))
        controller.step(sample(0))
        controller.command(Tune(current_limit_A=limit_A))
        controller.command(Follow(trajectories=(Sine(amplitude_mm=2.0, period_s=12.0, cycles=1),)))
        for k in range(1, 1200):
            here_m = 0.002 * math.sin(math.tau * 0.01 * k / 12.0)
            warm = sample(k, rtd_degC=(35.0, 28.0, 27.0, 27.0), displacement_m=here_m)
            if controller.step(warm).i_A[1] > 0.0:
                return k
        raise AssertionError("never reversed")

    assert begins_at(2.5) < begins_at(4.0) - 20


def test_without_a_sensor_in_the_water_the_configured_inlet_is_taken() -> None:
    here = sample(1, rtd_degC=(42.0, 30.0, math.nan, math.nan), displacement_m=0.0)
    advice = Anticipation(MODEL, 4.0).step(lambda lead: 0.001, here, (False, False), DT_S)
    assert math.isfinite(advice.lead_s)


def r2_of(tune: Tune, amplitude_mm: float, frequency_Hz: float) -> tuple[float, float, int]:
    """R² after the first cycle, hottest spring in °C, largest current in mA."""
    rows: list[tuple[float, float, float, int]] = []
    sine = Sine(amplitude_mm=amplitude_mm, period_s=1.0 / frequency_Hz, cycles=4)
    plan = Plan("sine", (Do(tune), Do(Follow(trajectories=(sine,))), UntilDone(200.0)))
    run_virtual(
        SimulatedBench(seed=2),
        Controller(ControlConfig(cooling=CoolingConfig(mode="proportional"))),
        plan,
        recorder=lambda s, state, _, reference, __: rows.append(
            (reference, s.displacement_m, max(s.rtd_degC[:2]), max(state.i_applied_mA))
        ),
    )
    later = rows[round(100 / frequency_Hz) :]
    return (
        tracking_r2([row[0] for row in later], [row[1] for row in later]),
        max(row[2] for row in rows),
        max(row[3] for row in rows),
    )


@pytest.mark.parametrize(
    ("amplitude_mm", "frequency_Hz", "drained_Hz"), [(2.0, 0.31, 0.5), (8.0, 0.12, 0.24)]
)
def test_the_inverse_follows_what_plain_pi_cannot_within_current_and_temperature(
    amplitude_mm: float, frequency_Hz: float, drained_Hz: float
) -> None:
    plain, _, _ = r2_of(Tune(), amplitude_mm, frequency_Hz)
    assert plain < 0.9
    for tune, at_Hz in (
        (Tune(feedforward=True), frequency_Hz),
        (Tune(feedforward=True, drain_before_heating=True), drained_Hz),
    ):
        r2, hottest_degC, most_mA = r2_of(tune, amplitude_mm, at_Hz)
        assert r2 > 0.9
        assert hottest_degC < 80.0
        assert most_mA <= 4000
