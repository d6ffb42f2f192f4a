"""A driver that runs out of headroom: driver_saturation."""

import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.effects.registry import effect

P = load_parameters("A")
I_MAX = P["current_max"]


def given(command_A, **values):
    """The current that X gets at each command."""
    i_A = np.column_stack([command_A, np.zeros_like(command_A)])
    t = np.arange(len(command_A)) * 0.01
    inputs = Inputs(t, i_A, np.zeros_like(i_A))
    effects = {"driver_saturation": values}
    out = simulate(P, inputs, effects=effects, outputs=("true_i_x_A",), dt_s=0.01)
    return out["true_i_x_A"][1:]


def held(amps, **values):
    return float(given(np.full(3, amps), **values)[-1])


@pytest.mark.parametrize("sharpness", [2.0, 6.0, 40.0])
@pytest.mark.parametrize("deficit", [1e-6, 0.02, 0.1, 0.5, 0.9])
def test_at_the_largest_current_the_deficit_is_missing(deficit, sharpness):
    missing = 1.0 - held(I_MAX, deficit=deficit, sharpness=sharpness) / I_MAX
    assert missing == pytest.approx(deficit, rel=1e-6)


@pytest.mark.parametrize("sharpness", [2.0, 6.0, 40.0])
@pytest.mark.parametrize("deficit", [1e-6, 0.02, 0.1, 0.5, 0.9])
def test_more_command_gives_more_current_and_never_more_than_it(deficit, sharpness):
    command = np.linspace(0.0, 1.2 * I_MAX, 200)
    current = given(command, deficit=deficit, sharpness=sharpness)
    assert (np.diff(current) >= -1e-15).all()
    assert (current <= command[1:]).all()
    assert current[0] > 0.0


def test_nothing_is_given_for_nothing():
    assert held(0.0, deficit=0.5) == 0.0


def test_without_a_deficit_nothing_is_missing_however_sharp():
    assert held(I_MAX, deficit=0.0, sharpness=2.0) == I_MAX


def test_a_small_deficit_comes_on_smoothly():
    """Twice as little is twice as little missing, at every current."""
    for amps in (2.0, 3.0, I_MAX):
        small, smaller = (amps - held(amps, deficit=s, sharpness=6.0) for s in (1e-4, 5e-5))
        assert small == pytest.approx(2.0 * smaller, rel=1e-3)


@pytest.mark.parametrize("deficit", [0.05, 0.3, 0.8])
def test_the_sharpest_knee_is_nearly_a_clip(deficit):
    command = np.linspace(0.0, I_MAX, 400)
    sharpest = effect("driver_saturation").parameter("sharpness").high
    current = given(command, deficit=deficit, sharpness=sharpest)
    clip = np.minimum(command[1:], (1.0 - deficit) * I_MAX)
    np.testing.assert_allclose(current, clip, rtol=0.04)
    away = np.abs(command[1:] / ((1.0 - deficit) * I_MAX) - 1.0) > 0.1
    np.testing.assert_allclose(current[away], clip[away], rtol=0.005)


def test_a_recorded_bench_loses_its_current_so():
    for amps, missing in ((2.8, 0.0018), (3.2, 0.0045), (4.0, 0.02)):
        share = 1.0 - held(amps, deficit=0.02, sharpness=7.0) / amps
        assert share == pytest.approx(missing, abs=5e-5), amps
