"""Steps of an exact replay: short where something happens, long where nothing is driven."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sim_device.plant.replay import Inputs
from smad.diagnosis.spring_pair.steps import LONGEST_STEP_S, STEP_S, Steps


def inputs_of(current: Callable[[np.ndarray], np.ndarray], rate_hz: float = 100.0) -> Inputs:
    """Ten seconds in which X gets a current, and nothing else is driven."""
    t_s = np.arange(1, round(10 * rate_hz) + 1) / rate_hz
    i_A = np.column_stack([current(t_s), np.zeros(len(t_s))])
    return Inputs(t_s, i_A=i_A, pump_duty=np.zeros((len(t_s), 2)))


def pulse(t_s: np.ndarray) -> np.ndarray:
    return np.where((t_s > 2.0) & (t_s <= 5.0), 1.5, 0.0)


def spans(steps: Steps, begin_s: float, end_s: float) -> np.ndarray:
    """How long the steps are that end between two times."""
    inside = (steps.t_s[1:] > begin_s + 1e-9) & (steps.t_s[1:] <= end_s + 1e-9)
    return np.diff(steps.t_s)[inside]


@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 500.0])
def test_steps_are_short_after_a_change_and_longest_while_nothing_is_driven(rate_hz: float) -> None:
    steps = Steps.of(inputs_of(pulse, rate_hz))
    assert spans(steps, 2.0, 2.3).max() <= 1.3 * STEP_S
    assert spans(steps, 5.0, 5.3).max() <= 1.3 * STEP_S
    assert STEP_S < np.median(spans(steps, 3.0, 5.0)) <= 0.015
    assert 0.03 < np.median(spans(steps, 6.0, 10.0)) <= LONGEST_STEP_S


@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 500.0])
def test_every_change_of_an_input_begins_and_ends_a_step_with_its_sample(rate_hz: float) -> None:
    inputs = inputs_of(pulse, rate_hz)
    steps = Steps.of(inputs)
    assert (np.diff(steps.t_s) > 0.0).all()
    for k in np.flatnonzero(np.diff(inputs.rows[:, 0])) + 1:
        for t_s in inputs.t_s[k - 1 : k + 1]:
            assert np.abs(steps.t_s - t_s).min() < 1e-9
    # The input in force over each step is that of the sample in which it ends.
    sample = np.searchsorted(inputs.t_s, steps.t_s - 1e-9)
    assert np.array_equal(steps.inputs.rows, inputs.rows[sample])


def test_a_current_that_chatters_is_replayed_in_short_steps() -> None:
    steps = Steps.of(inputs_of(lambda t_s: 1.0 + 0.5 * (np.arange(len(t_s)) % 20 < 10)))
    assert spans(steps, 0.0, 10.0).max() <= STEP_S


def test_a_current_that_changes_little_with_every_sample_has_a_step_for_each() -> None:
    inputs = inputs_of(lambda t_s: 1.0 + 0.1 * np.sin(t_s))
    steps = Steps.of(inputs)
    settled = inputs.t_s > 0.5
    assert np.array_equal(steps.t_s[steps.t_s > 0.5], inputs.t_s[settled])


def test_a_forcing_that_varies_is_kept_and_one_that_does_not_changes_no_step() -> None:
    inputs = inputs_of(pulse)
    plain = Steps.of(inputs)
    assert np.array_equal(Steps.of(inputs, [np.ones(1000)]).t_s, plain.t_s)
    varying = Steps.of(inputs, [np.linspace(0.0, 1.0, 1000)])
    assert set(range(1000)) == set(varying.sample.tolist())


def test_readings_run_straight_between_the_ends_of_steps_and_jump_where_an_input_does() -> None:
    inputs = inputs_of(pulse, 500.0)
    steps = Steps.of(inputs)
    shown = steps.at_samples({"line": 3.0 * steps.t_s, "current": steps.inputs.rows[:, 0]})
    np.testing.assert_allclose(shown["line"], 3.0 * inputs.t_s, rtol=1e-12)
    np.testing.assert_allclose(shown["current"], inputs.rows[:, 0], atol=1e-12)


def test_one_sample_is_one_step() -> None:
    one = Inputs(np.array([0.01]), i_A=np.zeros((1, 2)), pump_duty=np.zeros((1, 2)))
    assert Steps.of(one).t_s.tolist() == [0.01]
