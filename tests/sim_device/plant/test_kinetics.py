"""Phase fractions under any history of temperature and stress, against Eqs (11) to (13)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_device.plant import load_parameters, simulate
from sim_device.plant.parameters import initial_detwinned, spring_factors
from tests.sim_device.plant.cases import still

P = load_parameters("A")
C1, _ = spring_factors(P)
ZERO_C = 273.15
KEPT = ("xi_S_x", "xi_T_x")


def along(T_C, force_N, parameters=P, per_leg=400, dt_s=10.0, **options):
    """ξ_S, ξ_T and the path (T in K, τ in Pa) along straight legs through the corners given."""
    T_C, force_N = np.asarray(T_C, float), np.asarray(force_N, float)
    corners = np.arange(T_C.size) * per_leg
    n = corners[-1] + 1
    T = np.interp(np.arange(n), corners, T_C) + ZERO_C
    F = np.interp(np.arange(n), corners, force_N)
    t = np.arange(n) * 0.01
    feeds = {"temperature_K": np.column_stack([T, T]), "force_N": F}
    out = simulate(parameters, still(t), feeds=feeds, outputs=KEPT, dt_s=dt_s, **options)
    return out["xi_S_x"], out["xi_T_x"], T, C1 * F


def left(x):
    return 0.5 * (np.cos(np.pi * np.clip(x, 0, 1)) + 1)


def reverse(T, tau):
    span = P["austenite_finish"] - P["austenite_start"]
    return (T - P["austenite_start"] - tau / P["slope_austenite"]) / span


def forward(T, tau):
    band = P["stress_finish"] - P["stress_start"]
    lowered = tau - P["slope_martensite"] * np.maximum(T - P["martensite_start"], 0)
    return (lowered - P["stress_start"]) / band


@pytest.mark.parametrize("force_N", [0.0, 0.6, 1.24])
def test_a_full_heating_follows_eq_11_with_both_fractions_in_one_ratio(force_N):
    xs, xt, T, tau = along([20, 62], [force_N, force_N])
    first = initial_detwinned(P)
    expected = left(reverse(T, tau))
    np.testing.assert_allclose(xs + xt, expected, atol=1e-12)
    np.testing.assert_allclose(xs, first * expected, atol=1e-12)
    assert xs[-1] + xt[-1] == 0.0


def test_cold_detwinning_follows_eq_12_on_the_characteristic_curve():
    xs, xt, T, tau = along([25, 25], [0.0, 4.0])
    first = initial_detwinned(P)
    curve = np.maximum(first, 1 - left(forward(T, tau)))
    np.testing.assert_allclose(xs, curve, atol=1e-12)
    np.testing.assert_allclose(xs + xt, 1.0, atol=1e-12)


def test_detwinning_starts_where_the_linear_path_meets_the_curve():
    xs, _, T, tau = along([25, 25], [1.24, 2.5])
    first = initial_detwinned(P)
    started = np.flatnonzero(xs > first)[0]
    assert 1 - left(forward(T, tau))[started - 1] <= first <= 1 - left(forward(T, tau))[started]
    assert tau[started] > P["stress_start"]


@pytest.mark.parametrize("T_C", [40.0, 45.0])
def test_loading_austenite_above_martensite_start_follows_eq_13(T_C):
    xs, xt, T, tau = along([25, 70, T_C, T_C], [0.0, 0.0, 0.0, 6.0])
    tail = slice(800, None)
    b = forward(T, tau)[tail]
    reached = 1 - left(b)
    np.testing.assert_allclose(xs[tail], reached, atol=1e-10)
    np.testing.assert_allclose(xt[tail], 0.0, atol=1e-12)


def test_cooling_austenite_under_stress_follows_eq_13_down_to_martensite_start():
    xs, _, T, tau = along([25, 75, 36], [0.0, 2.6, 2.6])
    tail = slice(400, None)
    above = T[tail] > P["martensite_start"]
    expected = 1 - left(forward(T, tau)[tail])
    np.testing.assert_allclose(xs[tail][above], expected[above], atol=1e-10)


def test_cooling_without_stress_makes_twinned_martensite_by_eq_12c():
    xs, xt, T, _ = along([25, 70, 25], [0.0, 0.0, 0.0])
    tail = slice(400, None)
    c = (P["martensite_start"] - T[tail]) / (P["martensite_start"] - P["martensite_finish"])
    np.testing.assert_allclose(xt[tail], 1 - left(c), atol=1e-12)
    np.testing.assert_allclose(xs[tail], 0.0, atol=1e-12)


def test_a_partial_loop_goes_on_from_what_is_left_in_the_ratio_of_the_law():
    once = along([25, 38], [0.8, 0.8])
    again = along([25, 38, 36.5, 38], [0.8] * 4)
    tau = C1 * 0.8
    ratio = left(reverse(38 + ZERO_C, tau)) / left(reverse(36.5 + ZERO_C, tau))
    for one, other in zip(once[:2], again[:2], strict=True):
        assert other[-1] == pytest.approx(one[-1] * ratio, rel=1e-9)
    finished = along([25, 38, 36.5, 41, 36, 60], [0.8] * 6)
    assert finished[0][-1] + finished[1][-1] == 0.0


def test_a_restart_in_mid_transformation_continues_without_a_jump():
    xs, xt, *_ = along([25, 38, 37.9, 50], [0.8] * 4, per_leg=2000)
    change = np.abs(np.diff(xs + xt))
    assert change.max() < 3 * np.median(change[change > 0])


def test_unloading_hot_austenite_leaves_no_martensite_behind():
    xs, xt, *_ = along([25, 80, 80, 80], [0.0, 0.0, 9.0, 0.0], per_leg=3000)
    assert (xs + xt).max() > 0.1
    assert xs[-1] + xt[-1] < 1e-9


corner = st.tuples(st.floats(22.0, 60.0), st.floats(0.0, 3.0))
path = st.lists(corner, min_size=2, max_size=7)
hot_corner = st.tuples(st.floats(0.0, 95.0), st.floats(0.0, 12.0))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.lists(hot_corner, min_size=2, max_size=8), st.sampled_from([1e-3, 3e-3, 1e-2]))
def test_fractions_stay_within_bounds_and_add_up_on_any_path(corners, dt_s):
    T_C, force_N = zip(*corners, strict=True)
    xs, xt, *_ = along([25.0, *T_C], [0.0, *force_N], per_leg=60, dt_s=dt_s)
    for fraction in (xs, xt, xs + xt):
        assert fraction.min() >= 0.0
        assert fraction.max() <= 1.0


@settings(derandomize=True, deadline=None, max_examples=40)
@given(path)
def test_a_finer_path_has_finer_steps_so_that_nothing_jumps(corners):
    T_C, force_N = zip(*corners, strict=True)

    def largest_step(per_leg):
        xs, xt, *_ = along([25.0, *T_C], [1.24, *force_N], per_leg=per_leg)
        return max(np.abs(np.diff(xs)).max(), np.abs(np.diff(xt)).max())

    coarse, fine = largest_step(50), largest_step(800)
    assert fine < coarse / 8 + 1e-3


@settings(derandomize=True, deadline=None, max_examples=40)
@given(path)
def test_heating_alone_never_makes_martensite_and_cooling_alone_never_unmakes_it(corners):
    T_C, force_N = zip(*corners, strict=True)
    force = force_N[0]
    T_C = [25.0, *T_C]
    xs, xt, T, _ = along(T_C, [force] * len(T_C), per_leg=80)
    change = np.diff(xs + xt)
    assert change[np.diff(T) > 0].max(initial=-1.0) <= 1e-12
    assert change[np.diff(T) < 0].min(initial=1.0) >= -1e-12


@settings(derandomize=True, deadline=None, max_examples=40)
@given(path, st.integers(1, 6))
def test_the_result_depends_on_the_path_and_not_on_how_it_is_cut(corners, factor):
    T_C, force_N = zip(*corners, strict=True)
    base = along([25.0, *T_C], [1.24, *force_N], per_leg=400)
    finer = along([25.0, *T_C], [1.24, *force_N], per_leg=400, dt_s=0.01 / factor)
    for one, other in zip(base[:2], finer[:2], strict=True):
        assert np.abs(one - other).max() < 0.02


def test_both_transformations_at_once_share_the_work_and_converge():
    results = [
        along([25, 52, 56], [0.0, 3.4, 5.2], per_leg=n)[0][-1] for n in (100, 1000, 10000, 40000)
    ]
    errors = np.abs(np.array(results[:-1]) - results[-1])
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-4
