"""Metrics against shapes whose answer is known."""

import math

import numpy as np
import pytest

from smad.control.metrics import (
    peak,
    r2_by_period,
    ripple,
    rms,
    starts,
    step_response,
    tracking_r2,
)

T_S = np.arange(0.0, 70.0, 0.01)
SINE = 2.0 * np.sin(2.0 * np.pi * T_S / 7.0)


def test_perfect_tracking_scores_one_and_no_motion_zero() -> None:
    assert tracking_r2(SINE, SINE) == 1.0
    assert tracking_r2(SINE, np.zeros_like(SINE)) == pytest.approx(0.0, abs=1e-6)


def test_a_lag_of_phi_scores_two_cos_phi_less_one() -> None:
    for phi in (0.05, 0.2, 0.4):
        lagged = 2.0 * np.sin(2.0 * np.pi * T_S / 7.0 - phi)
        assert tracking_r2(SINE, lagged) == pytest.approx(2.0 * math.cos(phi) - 1.0, abs=1e-6)


def test_missing_samples_are_left_out() -> None:
    holed = SINE.copy()
    holed[100:200] = math.nan
    assert tracking_r2(SINE, holed) == 1.0
    assert math.isnan(tracking_r2(np.zeros(5), np.zeros(5)))


def test_each_period_is_scored_by_itself() -> None:
    actual = np.where(T_S < 35.0, SINE, 0.0)
    scores = r2_by_period(T_S, SINE, actual, 7.0)
    assert len(scores) == 10
    assert scores[:5] == [1.0] * 5
    assert max(scores[5:]) < 0.01


def test_a_first_order_step_has_the_textbook_times() -> None:
    response = step_response(T_S, 10.0 * (1.0 - np.exp(-T_S / 2.0)), 10.0, start=0.0)
    assert response.rise_time_s == pytest.approx(2.0 * math.log(9.0), abs=0.02)
    assert response.settling_time_s == pytest.approx(2.0 * math.log(20.0), abs=0.02)
    assert response.overshoot_fraction == 0.0


def test_overshoot_is_a_share_of_the_step_and_works_downward() -> None:
    ringing = -5.0 * (1.0 - 1.2 * np.exp(-T_S) * np.cos(3.0 * T_S))
    response = step_response(T_S, ringing, -5.0, start=0.0)
    assert response.overshoot_fraction == pytest.approx(
        1.2 * np.max(-np.exp(-T_S) * np.cos(3.0 * T_S)), abs=1e-6
    )


def test_a_step_that_is_never_reached_has_no_times() -> None:
    response = step_response(T_S, np.minimum(T_S, 5.0), 10.0, start=0.0)
    assert math.isnan(response.rise_time_s)
    assert math.isnan(response.settling_time_s)


def test_a_step_without_height_is_refused() -> None:
    with pytest.raises(ValueError, match="no height"):
        step_response([0.0, 1.0], [3.0, 3.0], 3.0)


def test_the_peak_ignores_missing_values() -> None:
    assert peak([1.0, math.nan, 3.0]) == 3.0
    assert math.isnan(peak([math.nan]))


def test_a_hold_is_judged_by_its_ripple_beside_a_slow_change_by_error_and_starts() -> None:
    t_s = np.arange(0.0, 20.0, 0.01)
    nothing = np.zeros_like(t_s)
    current_A = 1.0 + 0.05 * t_s + 0.1 * np.sin(2.0 * np.pi * 5.0 * t_s)
    duty_y = np.where(t_s % 8.0 > 6.0, 1.0, 0.0)
    assert ripple(t_s, -current_A) == pytest.approx(0.1 / math.sqrt(2.0), rel=0.02)
    assert rms(nothing - 0.2) == pytest.approx(0.2)
    assert (starts(nothing), starts(duty_y)) == (0, 2)
