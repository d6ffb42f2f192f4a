"""The pair's equilibrium: always found, never in compression, and the paper's four steps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.parameters import spring_factors
from tests.sim_device.plant.cases import still

P = load_parameters("A")
C1, C2 = spring_factors(P)
K_M = C2 / C1 * P["modulus_martensite"]
K_A = C2 / C1 * P["modulus_austenite"]
D0, F0, DL = P["initial_deflection"], P["initial_force"], P["max_deflection"]


def stiffness(out, side):
    xi = out[f"xi_S_{side}"] + out[f"xi_T_{side}"]
    return xi * K_M + (1 - xi) * K_A


def cycle():
    """X heated through its transformation, cooled, then Y: the cycle of Fig. 9."""
    t = np.arange(8000) * 0.01
    i_A = np.zeros((t.size, 2))
    duty = np.zeros((t.size, 2))
    i_A[1:1200, 0] = 3.0
    duty[1300:3900, 0] = 1.0
    i_A[4000:5200, 1] = 3.0
    duty[5300:, 1] = 1.0
    return Inputs(t, i_A, duty)


@pytest.fixture(scope="module")
def run():
    return simulate(P, cycle())


def alpha(run, part, side="x"):
    return K_M / stiffness(run, side)[part]


def test_step_1_the_unheated_spring_is_loaded_linearly_eq_32(run):
    meets = np.flatnonzero(run["xi_S_y"] > run["xi_S_y"][0])[0]
    part = slice(0, meets)
    expected = (K_M * (D0 - DL * run["xi_S_x"][part]) + F0) / (1 + alpha(run, part))
    np.testing.assert_allclose(run["force_N"][part], expected, rtol=1e-9)
    assert run["xi_S_x"][meets] + run["xi_T_x"][meets] == pytest.approx(0.27, abs=0.01)


def test_step_2_the_unheated_spring_follows_the_martensite_curve_eq_35(run):
    meets = np.flatnonzero(run["xi_S_y"] > run["xi_S_y"][0])[0]
    part = slice(meets, 1200)
    xs = run["xi_S_x"][part] + run["xi_S_y"][part]
    expected = K_M * (2 * D0 - DL * xs) / (1 + alpha(run, part))
    np.testing.assert_allclose(run["force_N"][part], expected, rtol=1e-9)
    b = (C1 * run["force_N"][part] - P["stress_start"]) / (P["stress_finish"] - P["stress_start"])
    np.testing.assert_allclose(run["xi_S_y"][part], 0.5 * (1 - np.cos(np.pi * b)), atol=1e-9)
    assert run["xi_S_x"][1200] + run["xi_T_x"][1200] < 1e-6


def test_step_3_cooling_unloads_along_the_martensite_slope_eq_36(run):
    part = slice(1400, 3900)
    top_x, top_F = run["deflection_x_m"][1200], run["force_N"][1200]
    expected = (K_M * (top_x - DL * run["xi_S_x"][part]) + top_F) / (1 + alpha(run, part))
    np.testing.assert_allclose(run["force_N"][part], expected, rtol=1e-9)
    assert run["deflection_y_m"][3899] == pytest.approx(26.2e-3, abs=0.05e-3)
    assert run["force_N"][3899] == pytest.approx(1.228, abs=2e-3)


def test_step_4_the_other_spring_does_the_same_and_the_cycle_closes(run):
    assert run["displacement_m"][5199] == pytest.approx(-10e-3, abs=0.05e-3)
    assert run["displacement_m"][1199] == pytest.approx(10e-3, abs=0.05e-3)
    part = slice(4600, 5200)
    xs = run["xi_S_x"][part] + run["xi_S_y"][part]
    a = alpha(run, part, "y")
    started = run["xi_S_x"][part] > run["xi_S_x"][4000] + 1e-9
    expected = K_M * (2 * D0 - DL * xs) / (1 + a)
    np.testing.assert_allclose(run["force_N"][part][started], expected[started], rtol=1e-9)


def test_the_pair_always_fills_its_length_and_carries_one_tension(run):
    total = run["deflection_x_m"] + run["deflection_y_m"]
    np.testing.assert_allclose(total, 2 * D0, atol=2e-12)
    np.testing.assert_array_equal(run["spring_force_x_N"], run["spring_force_y_N"])


bounded = {
    "resistivity": (0.4e-6, 1.1e-6),
    "austenite_start": (296.15, 305.15),
    "austenite_finish": (306.15, 318.15),
    "martensite_start": (305.15, 311.15),
    "martensite_finish": (299.15, 304.15),
    "slope_austenite": (5e6, 11e6),
    "slope_martensite": (3e6, 9e6),
    "stress_start": (45e6, 66e6),
    "stress_finish": (80e6, 190e6),
    "max_deflection": (20e-3, 55e-3),
    "latent_heating": (0.0, 25000.0),
    "warming_share": (0.1, 1.0),
}
one_set = st.fixed_dictionaries({name: st.floats(*span) for name, span in bounded.items()})
pulse = st.tuples(st.floats(0, 4), st.floats(0, 4), st.floats(0, 1), st.floats(0, 1))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    one_set,
    st.lists(pulse, min_size=1, max_size=6),
    st.sampled_from(["water", "air"]),
    st.sampled_from(["antagonistic", "blocked"]),
    st.sampled_from([1e-3, 1e-2]),
)
def test_equilibrium_is_found_and_tension_is_never_negative(values, pulses, cooling, fixture, dt_s):
    drives = np.repeat(np.array(pulses), 120, axis=0)
    t = np.arange(len(drives)) * 0.02
    inputs = Inputs(t, drives[:, :2], drives[:, 2:])
    out = simulate(P.replace(**values), inputs, cooling=cooling, fixture=fixture, dt_s=dt_s)
    assert out["true_force_N"].min() >= 0.0
    for side in "xy":
        total = out[f"xi_S_{side}"] + out[f"xi_T_{side}"]
        assert out[f"xi_S_{side}"].min() >= 0
        assert out[f"xi_T_{side}"].min() >= 0
        assert total.max() <= 1.0
    if fixture == "antagonistic":
        length = out["deflection_x_m"] + out["deflection_y_m"]
        tight = out["true_force_N"] > 0.0
        # Temperatures are settled to 1e-9 K; the deflection follows to better than a nanometre.
        assert np.abs(length - 2 * D0)[tight].max(initial=0.0) < 1e-9
        assert (length[~tight] >= 2 * D0 - 1e-9).all()


def test_a_pair_stretched_beyond_its_length_goes_slack_and_not_into_compression():
    t = np.arange(3000) * 0.01
    wire = P.replace(max_deflection=0.054, initial_force=1.0)
    force = np.interp(t, [0, 10, 15, 30], [1.0, 7.0, 7.0, 0.0])
    feeds = {"temperature_K": np.full((t.size, 2), 298.15), "force_N": force}
    out = simulate(wire, still(t), feeds=feeds)
    assert out["xi_S_x"][-1] > 0.9
    assert out["true_force_N"][-1] == 0.0
    assert out["deflection_x_m"][-1] + out["deflection_y_m"][-1] > 2 * D0


def test_a_stretched_spring_follows_the_two_characteristic_curves():
    t = np.arange(2000) * 0.01
    stage = np.interp(t, [0, 20], [0, 95e-3])
    for T_C, k, limit in ((25.0, K_M, 58e6), (60.0, K_A, 170e6)):
        warm = np.full((t.size, 2), T_C + 273.15)
        warm[0] = 298.15
        out = simulate(P, still(t, stage_m=stage), fixture="stretch", feeds={"temperature_K": warm})
        linear = (C1 * out["force_N"] < 0.98 * limit) & (t > 0.1)
        np.testing.assert_allclose(out["force_N"][linear], k * stage[linear], rtol=1e-6)
        assert out["xi_S_x"][-1] > 0.6
        assert out["force_N"][-1] < k * stage[-1]


def test_a_blocked_spring_pulls_harder_when_heated_and_its_walls_can_be_moved_apart():
    t = np.arange(4000) * 0.01
    i_A = np.zeros((t.size, 2))
    i_A[1000:3000, 0] = 3.5
    for apart in (0.0, 10e-3):
        stage = np.interp(t, [0, 5], [0, apart])
        out = simulate(P, Inputs(t, i_A, 0 * i_A, stage_m=stage), fixture="blocked")
        cold, hot = out["force_N"][999], out["force_N"][2999]
        assert hot == pytest.approx(K_A * (D0 + apart), rel=1e-3)
        assert cold < 0.75 * hot
