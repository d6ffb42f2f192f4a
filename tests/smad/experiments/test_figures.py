"""Figures 9 to 13: what the paper states, and what the reference says of this model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from smad.experiments.cycle_theory import cycle_theory
from smad.experiments.fig9_cycle import CycleOptions, Fig9Cycle, deviation
from smad.experiments.fig10_thermal import (
    Fig10Thermal,
    ThermalOptions,
    biot_number,
    cooling_time,
    heating_time,
    replay,
)
from smad.experiments.fig11_tracking import Fig11Tracking, TrackingOptions
from smad.experiments.fig12_frequency import (
    AMPLITUDES_MM,
    Fig12Frequency,
    FrequencyOptions,
    Largest,
    largest_frequency,
)
from smad.experiments.fig13_segment import Fig13Segment, SegmentOptions
from smad.experiments.recording import Recording
from smad.experiments.tracking import Score, score_of

from .helpers import NOMINAL, driver, given


def test_the_closed_form_of_the_cycle_has_the_papers_numbers() -> None:
    theory = cycle_theory(NOMINAL)
    assert theory.xi_at_curve == pytest.approx(0.27, abs=0.005)
    assert theory.curve_force_N == pytest.approx(1.67, abs=0.01)
    assert theory.full_deflection_m == pytest.approx(0.035, abs=2e-4)
    assert theory.full_force_N == pytest.approx(1.743, abs=0.005)
    assert theory.back_deflection_m == pytest.approx(0.0262, abs=1e-4)
    assert theory.back_force_N == pytest.approx(1.228, abs=0.003)


@pytest.mark.parametrize("parameters", [NOMINAL, given()], ids=["nominal", "another bench"])
def test_the_bench_goes_through_the_four_steps_as_the_closed_form_says(parameters: object) -> None:
    theory = cycle_theory(parameters)
    stroke_mm = theory.full_deflection_m * 1e3 - parameters["initial_deflection"] * 1e3
    experiment = Fig9Cycle(CycleOptions(step_mm=stroke_mm, heat_s=15.0, cool_s=20.0, cycles=2))
    run = experiment.conduct(experiment.name, driver(parameters))
    assert deviation(run, theory, parameters) < 0.02
    after_x = run.between("x cools", "y heats")["displacement_mm"][-1]
    after_y = run.between("y cools", "end")["displacement_mm"][-1]
    assert after_y == pytest.approx(-after_x, abs=0.1), "the cycle is not symmetric"
    assert run["displacement_mm"][-1] == pytest.approx(after_y, abs=0.03), "it does not close"


def test_a_cycle_that_hardly_moved_is_not_said_to_be_as_the_closed_form() -> None:
    t_s = np.arange(0.5, 6.0)
    columns = {"t_s": t_s, "displacement_mm": 0.0 * t_s, "force_N": 0.0 * t_s + 1.0}
    still = Recording(columns, {"x heats": 0.0, "x cools": 2.0, "y heats": 5.0})
    assert math.isnan(deviation(still, cycle_theory(NOMINAL), NOMINAL))


def test_heating_and_cooling_take_as_long_as_the_physics_page_says() -> None:
    experiment = Fig10Thermal(ThermalOptions())
    assert heating_time(experiment.conduct("fig10-thermal/4A", driver())) < 8.0
    run = experiment.conduct("fig10-thermal/1A", driver())
    assert heating_time(run) == pytest.approx(162.0, rel=0.02)
    assert cooling_time(run, 310.0) == pytest.approx(3.9, rel=0.05)
    assert cooling_time(run, 305.0) == pytest.approx(8.6, rel=0.05)
    assert math.isnan(cooling_time(run, 290.0))
    assert max(replay(run, NOMINAL, "printed")) < 310.0
    lost = run["rtd_x_degC"].copy()
    lost[3] = np.nan
    warming = replay(Recording({**run.columns, "rtd_x_degC": lost}, run.marks), NOMINAL, "extended")
    assert max(abs(warming - run["rtd_x_degC"] - 273.15)) < 0.5


def test_water_keeps_up_with_seven_seconds_and_air_loses_them_after_some_periods() -> None:
    experiment = Fig11Tracking(TrackingOptions(cycles=10, beyond=False))
    findings = experiment.run(driver(), NOMINAL)
    water, air = findings.comparisons
    assert float(water.here.split()[0]) > 0.9927
    good = int(air.here.split()[0])
    assert 4 <= good <= 9
    assert "then lost" in air.paper


def test_the_segment_turns_by_twenty_five_degrees() -> None:
    findings = Fig13Segment(SegmentOptions(cycles=1, hold_s=4.0)).run(driver(), NOMINAL)
    low, high = (float(word.rstrip("°")) for word in findings.comparisons[0].here.split()[:3:2])
    assert low == pytest.approx(-25.0, abs=0.7)
    assert high == pytest.approx(25.0, abs=0.7)


def test_the_biot_number_is_that_of_the_papers_numbers_and_not_the_one_it_states() -> None:
    assert biot_number(NOMINAL, 0.0) == pytest.approx(0.064, abs=0.005)
    assert biot_number(NOMINAL, 1.0) == pytest.approx(0.353, abs=0.01)


class Follower:
    """Follows up to a known frequency, and counts how often it is asked."""

    def __init__(self, largest_Hz: float) -> None:
        self.largest_Hz = largest_Hz
        self.asked = 0

    def __call__(self, frequency_Hz: float) -> Score:
        self.asked += 1
        r2 = 0.95 if frequency_Hz <= self.largest_Hz else 0.5
        return Score(r2, r2, (r2,), 50.0, 4.0)


@pytest.mark.parametrize("largest_Hz", [0.003, 0.05, 0.143, 0.6, 2.9])
def test_the_search_finds_the_largest_frequency_to_its_resolution(largest_Hz: float) -> None:
    follow = Follower(largest_Hz)
    found = largest_frequency(follow, 0.2, lowest_Hz=0.002, highest_Hz=3.0, resolution=0.02)
    assert largest_Hz / 1.021 < found.frequency_Hz <= largest_Hz
    assert follow.asked == len(found.tried) < 16


def test_a_search_that_never_succeeds_says_zero_and_one_that_always_does_the_highest() -> None:
    limits = {"lowest_Hz": 0.01, "highest_Hz": 1.0, "resolution": 0.05}
    never = largest_frequency(Follower(1e-6), 0.2, **limits)
    assert (never.frequency_Hz, never.score) == (0.0, None)
    assert largest_frequency(Follower(10.0), 0.2, **limits).frequency_Hz == 1.0


def test_each_control_is_compared_with_plain_pi_at_every_amplitude() -> None:
    experiment = Fig12Frequency(FrequencyOptions())
    score = Score(0.91, 0.8, (0.8, 0.91), 55.0, 4.0)
    found = {
        trial: Largest(0.3 if "/both/" in trial else 0.15, score, ((0.15, 0.91),))
        for trial in experiment.trials()
    }
    findings = experiment.conclude(found, NOMINAL)
    assert len(findings.comparisons) == 5
    both = next(row for row in findings.comparisons if "feed-forward, drained" in row.fact)
    assert both.here == " ".join(["0.300"] * 6) + " Hz"
    assert both.note == " ".join(["2.00"] * 6) + " times plain PI; at most 55.0 °C, 4.00 A"
    table = findings.blocks[1]
    assert len(table.rows) == 5 * len(AMPLITUDES_MM)


def test_a_control_that_is_left_out_is_neither_run_nor_shown() -> None:
    experiment = Fig12Frequency(FrequencyOptions(air=False, beyond=False))
    trials = experiment.trials()
    assert {trial.split("/")[1] for trial in trials} == {"water"}
    lost = {trial: Largest(0.0, None, ((0.002, 0.1),)) for trial in trials}
    (row,) = experiment.conclude(lost, NOMINAL).comparisons
    assert row.here == " ".join(["0.000"] * 6) + " Hz"


def test_the_start_from_rest_counts_only_when_asked() -> None:
    tracking = Fig11Tracking(TrackingOptions(cycles=3, air=False, beyond=False))
    run = tracking.conduct("fig11-tracking/water", driver())

    class Replays:
        def run(self, plan: object) -> object:
            return run

    settings = {"lowest_Hz": 1 / 7, "highest_Hz": 1 / 7, "cycles": 3}
    left_out = Fig12Frequency(FrequencyOptions(**settings))
    counted = Fig12Frequency(FrequencyOptions(count_first=True, **settings))
    after = left_out.conduct("fig12-frequency/water/2", Replays()).tried[0][1]
    with_it = counted.conduct("fig12-frequency/water/2", Replays()).tried[0][1]
    score = score_of(run, 7.0)
    assert (after, with_it) == pytest.approx((score.r2, score.r2_all))
    assert with_it < after
