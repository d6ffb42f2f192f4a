"""Laws that a good bench follows too: the cooling front, the lift by stress, the outer curve."""

import numpy as np

from sim_device.plant import Drive, Inputs, Plant, load_parameters, simulate
from sim_device.plant import kernel as k
from sim_device.plant.effects.registry import EFFECTS

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


def test_stress_lifts_the_temperature_at_which_twinned_martensite_forms():
    t, i, duty = timeline(60.0)
    i[100:1500, 0] = 3.0
    duty[1600:2200, 0] = 0.3
    i[100:4000, 1] = 1.5  # Y pulls, so that X cools under more than its preload
    plain, lifted = (
        simulate(P, Inputs(t, i, duty), effects=e) for e in ({}, {"stress_lift": {"lift_K": 20.0}})
    )
    xi = [out["xi_S_x"] + out["xi_T_x"] for out in (plain, lifted)]
    assert xi[1][2200:].max() > xi[0][2200:].max() + 0.01


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
        "driver_lag", "rtd_lag", "channel_delay", "pump_lag", "cooling_front", "stress_lift",
        "minor_loop", "tube_wall",
    }  # fmt: skip
