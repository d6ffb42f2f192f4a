"""PI with anti-windup, and the cooling switch."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smad.config import CoolingConfig
from smad.control.cooling import Pump, Switch
from smad.control.pi import PI

DT_S = 0.01


@settings(deadline=None, derandomize=True, max_examples=80)
@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=200))
def test_output_and_integral_never_leave_their_bounds(errors: list[float]) -> None:
    pi = PI(2.0, 1.0, -4.0, 4.0, 0.5)
    for error in errors:
        assert -4.0 <= pi.step(error, DT_S) <= 4.0
        assert -4.0 <= pi.integral <= 4.0


def test_a_long_saturation_does_not_delay_the_way_back() -> None:
    pi = PI(1.0, 10.0, -4.0, 4.0, 0.5)
    for _ in range(1000):
        pi.step(5.0, DT_S)
    assert pi.step(-0.1, DT_S) < 0.1


def test_saturation_keeps_the_full_output_as_long_as_the_error_is_large() -> None:
    pi = PI(2.0, 1.0, -4.0, 4.0, 0.5)
    assert [pi.step(error, DT_S) for error in (10.0, 8.0, 5.0, 3.0, 2.1)] == [4.0] * 5


def test_the_integral_removes_a_steady_error() -> None:
    pi = PI(0.5, 2.0, 0.0, 4.0, 0.5)
    level = 0.0
    for _ in range(3000):
        level += DT_S * (pi.step(1.0 - level, DT_S) - level)
    assert level == pytest.approx(1.0, abs=1e-3)


def test_a_preset_makes_the_next_output_what_it_was() -> None:
    pi = PI(2.0, 1.0, -4.0, 4.0, 0.5)
    pi.preset(1.3, error=0.2)
    assert pi.step(0.2, 0.0) == pytest.approx(1.3)


def test_feedforward_adds_within_the_bounds() -> None:
    pi = PI(1.0, 0.0, -4.0, 4.0, 0.5)
    assert pi.step(0.5, DT_S, feedforward=1.0) == pytest.approx(1.5)
    assert pi.step(0.5, DT_S, feedforward=9.0) == 4.0


def test_the_switch_has_hysteresis() -> None:
    switch = Switch(1.0, 0.5, 0.0, 0.0)
    assert [switch.step(demand, DT_S) for demand in (0.9, 1.1, 0.7, 0.4, 0.7)] == [
        False, True, True, False, False
    ]  # fmt: skip


def test_the_switch_keeps_its_shortest_times() -> None:
    switch = Switch(1.0, 0.5, 0.2, 0.3)
    states = [switch.step(2.0 if k % 2 else 0.0, DT_S) for k in range(400)]
    changes = [k for k in range(1, 400) if states[k] != states[k - 1]]
    lengths: dict[bool, list[float]] = {True: [], False: []}
    for a, b in pairwise(changes):
        lengths[states[a]].append((b - a) * DT_S)
    assert min(lengths[True]) >= 0.2 - 1e-9
    assert min(lengths[False]) >= 0.3 - 1e-9


@pytest.mark.parametrize("mode", ["switch", "proportional", "off"])
def test_water_stops_at_once_when_its_spring_is_to_heat(mode: str) -> None:
    pump = Pump(CoolingConfig(mode=mode, min_on_s=10.0))
    pump.step(4.0, False, DT_S)
    assert pump.step(4.0, True, DT_S) == 0.0


def test_proportional_duty_is_the_demand_over_four_amperes() -> None:
    pump = Pump(CoolingConfig(mode="proportional"))
    assert [pump.step(demand, False, DT_S) for demand in (0.0, 1.0, 4.0, 9.0)] == [
        0.0,
        0.25,
        1.0,
        1.0,
    ]


def test_mode_off_never_runs_the_pump() -> None:
    pump = Pump(CoolingConfig(mode="off"))
    assert pump.step(4.0, False, DT_S) == 0.0
