"""Laws that a good bench follows too: the cooling front, the unified kinetics, the outer curve."""

from itertools import pairwise

import numpy as np
import pytest

from sim_device.plant import Drive, Inputs, Plant, load_parameters, simulate
from sim_device.plant import kernel as k
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.replay import Replay

P = load_parameters("A")


def timeline(seconds, dt_s=0.01):
    n = round(seconds / dt_s) + 1
    return np.arange(n) * dt_s, np.zeros((n, 2)), np.zeros((n, 2))


def heated_then_pumped():
    """X at 3 A for 8 s, a pause, and three seconds of full flow."""
    t, i, duty = timeline(20.0)
    i[100:900, 0] = 3.0
    duty[1000:1300, 0] = 1.0
    return Inputs(t, i, duty)


def rtd_at(place, share=1.0):
    effects = {"cooling_front": {"share": share, "place": place}}
    return simulate(P, heated_then_pumped(), effects=effects)


def test_the_front_reaches_the_inlet_end_first():
    near, far = (rtd_at(place)["rtd_x_degC"][1100] for place in (0.1, 0.9))
    assert near < far - 5.0


def test_without_flow_every_place_is_as_warm_as_the_mean():
    out = rtd_at(0.9)
    np.testing.assert_allclose(out["rtd_x_degC"][:999], out["T_x_K"][:999] - 273.15, atol=1e-9)


def test_the_cells_keep_their_mean():
    effects = {"cooling_front": {"share": 1.0, "place": 0.5}}
    inputs = heated_then_pumped()
    places = [(c + 0.5) / k.CELLS for c in range(k.CELLS)]
    readings = [
        simulate(P, inputs, effects={"cooling_front": {"share": 1.0, "place": z}})["rtd_x_degC"]
        for z in places
    ]
    mean = simulate(P, inputs, effects=effects)["T_x_K"] - 273.15
    np.testing.assert_allclose(np.mean(readings, axis=0), mean, atol=1e-9)


def test_the_front_carries_heat_faster_out_of_a_hot_tube_and_the_books_still_close():
    stirred, plug = (
        simulate(P, heated_then_pumped(), effects=e)
        for e in ({}, {"cooling_front": {"share": 1.0, "place": 0.5}})
    )
    assert plug["heat_to_water_x_J"][1300] > stirred["heat_to_water_x_J"][1300]
    plant = Plant(P, effects={"cooling_front": {}})
    for n in range(1500):
        heating, pumping = n < 800, n >= 1000
        plant.advance(Drive(i_A=(3.0 * heating, 0.0), pump_duty=(1.0 * pumping, 0.0)), 0.01)
    assert abs(plant.energy.closing) < 1e-9 * plant.energy.heat_in


UNIFIED = {"unified_kinetics": {"on": 1.0, "tails": 0.3}}


def at_temperatures(x_degC, effects=UNIFIED, y_degC=27.0):
    """Fractions of X when its wire has these temperatures, 10 ms apart; Y stays cold."""
    t, i, duty = timeline((len(x_degC) - 1) * 0.01)
    fed = np.column_stack([x_degC, np.full(len(t), y_degC)]) + 273.15
    out = simulate(P, Inputs(t, i, duty), effects=effects, feeds={"temperature_K": fed})
    return out["xi_S_x"] + out["xi_T_x"], out


def ramps(*corners, rate_K_s=2.0):
    """Temperatures that go from corner to corner, and the rows at which they arrive."""
    pieces = [
        np.linspace(a, b, round(abs(b - a) / rate_K_s / 0.01) + 1)[1:] for a, b in pairwise(corners)
    ]
    arrive = np.cumsum([0, *(len(p) for p in pieces)])
    return np.r_[corners[0], *pieces], arrive


def test_a_whole_loop_of_the_unified_law_goes_to_austenite_and_back():
    T, at = ramps(27.0, 60.0, 20.0)
    xi, _ = at_temperatures(T)
    assert xi[0] == 1.0
    assert xi[at[1]] < 0.01
    assert xi[at[2]] > 0.97


def test_a_minor_loop_of_the_unified_law_closes_where_it_turned():
    T, at = ramps(27.0, 46.0, 36.0, 46.0, 36.0, 46.0, 60.0)
    xi, _ = at_temperatures(T)
    turned, back = xi[at[1]], xi[at[2]]
    assert back > turned + 0.05  # it has transformed in between
    np.testing.assert_allclose(xi[at[[3, 5]]], turned, atol=0.02)
    np.testing.assert_allclose(xi[at[4]], back, atol=0.02)
    straight, whole = ramps(27.0, 60.0)
    assert abs(xi[at[6]] - at_temperatures(straight)[0][whole[1]]) < 0.02


def test_a_small_ripple_on_the_way_does_not_transform_anything():
    T, at = ramps(27.0, 44.0)
    ripple = T + 0.1 * np.sin(np.arange(len(T)) * 0.9) * (T < 43.5)
    plain, rippled = (at_temperatures(x)[0][at[1]] for x in (T, ripple))
    assert abs(plain - rippled) < 0.01
    paper, ratchet = (at_temperatures(x, {})[0][at[1]] for x in (T, ripple))
    assert paper - ratchet > 0.05


def test_more_tension_makes_the_unified_law_form_martensite_earlier():
    T, at = ramps(27.0, 60.0, 35.0)
    loose, taut = (at_temperatures(T, y_degC=y) for y in (27.0, 45.0))
    assert taut[1]["force_N"][at[2]] > loose[1]["force_N"][at[2]] + 0.05
    assert taut[0][at[2]] > loose[0][at[2]] + 0.05


def test_the_unified_law_is_the_same_at_another_step():
    T, _ = ramps(27.0, 45.0, 34.0, 42.0, 30.0)
    xi = at_temperatures(T)[0]
    t, i, duty = timeline((len(T) - 1) * 0.01)
    fed = np.column_stack([T, np.full(len(T), 27.0)]) + 273.15
    out = simulate(
        P,
        Inputs(t[::5], i[::5], duty[::5]),
        effects=UNIFIED,
        feeds={"temperature_K": fed[::5]},
        dt_s=0.05,
    )
    coarse = out["xi_S_x"] + out["xi_T_x"]
    np.testing.assert_allclose(coarse, xi[::5], atol=5e-3)


def test_a_wire_that_remembers_rests_until_the_outer_curve_reaches_it():
    t, i, duty = timeline(22.0)
    i[100:800, 0] = 3.0  # half way to austenite
    duty[900:1100, 0] = 0.6  # a little back, not far enough to transform
    i[1500:2200, 0] = 3.0
    for memory, rests in ((0.0, False), (1.0, True)):
        effects = {"minor_loop": {"kappa": 0.0, "memory": memory}}
        out = simulate(P, Inputs(t, i, duty), effects=effects)
        xi, T = out["xi_S_x"] + out["xi_T_x"], out["T_x_K"]
        assert T[1600] < T[800]  # where it has been before
        assert bool(abs(xi[1600] - xi[1500]) < 1e-6) is rests
        assert xi[2100] < 0.1


def test_inlet_and_room_can_be_fed_as_they_were_measured():
    t, i, duty = timeline(20.0)
    i[100:600, 0] = 2.0
    duty[700:1500, 0] = 0.5
    inputs = Inputs(t, i, duty)
    warmer = np.full((len(t), 2), 302.0)
    plain = simulate(P, inputs)
    fed = simulate(P, inputs, feeds={"surroundings_K": warmer})
    assert fed["T_x_K"][1500] > plain["T_x_K"][1500] + 0.5
    np.testing.assert_array_equal(fed["rtd_inlet_degC"], plain["rtd_inlet_degC"])


def test_laws_are_marked():
    assert {e.name for e in EFFECTS if e.law} == {
        "driver_lag", "rtd_lag", "channel_delay", "pump_lag", "cooling_front",
        "minor_loop", "tube_wall", "unified_kinetics", "convection_exponent",
    }  # fmt: skip


@pytest.mark.parametrize("tails", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("spread_K", [0.0, 3.0])
def test_the_tabled_outer_curves_are_those_of_the_formula(tails, spread_K):
    effects = {
        "unified_kinetics": {"on": 1.0, "tails": tails},
        "temperature_spread": {"spread_K": spread_K},
    }
    curves = Replay(heated_then_pumped()).setup(P, effects).e.curves
    width = spread_K / (P["austenite_finish"] - P["austenite_start"])
    progress = np.linspace(k.PROGRESS_LOW, k.PROGRESS_HIGH, 1501)

    def cooling(x):
        cosine = np.where(x <= 0, 1.0, np.where(x >= 1, 0.0, np.cos(np.pi * x / 2) ** 2))
        logistic = 1.0 / (1.0 + np.exp(2 * np.pi * (x - 0.5)))
        return (1.0 - tails) * cosine + tails * logistic

    def heating(x):
        return 0.5 * cooling(x) + 0.25 * (cooling(x - width) + cooling(x + width))

    for curve, formula in ((curves.cooling, cooling), (curves.heating, heating)):
        both = np.zeros((len(progress), 2))
        for x, out in zip(progress, both, strict=True):
            k.outer_curve(curve, x, out)
        table, slope = both.T
        np.testing.assert_allclose(table, formula(progress), atol=2e-6)
        rise = (formula(progress + 1e-4) - formula(progress - 1e-4)) / 2e-4
        np.testing.assert_allclose(slope, rise, atol=2e-2)
