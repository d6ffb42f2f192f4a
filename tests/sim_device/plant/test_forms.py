"""Shapes of effects: where an R-phase begins, what a sensor sits on, how a loss grows."""

import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from tests.sim_device.plant.cases import alternating

P = load_parameters("A")
DRIVE = alternating(seconds=32.0, amps=2.6)


OUTPUTS = (
    "force_N", "true_displacement_m", "T_x_K", "spring_force_x_N", "spring_force_y_N",
    "rtd_ambient_degC", "v_x_V", "v_y_V",
)  # fmt: skip


def played(name=None, inputs=DRIVE, **values):
    effects = {name: values} if name else {}
    return simulate(P, inputs, effects=effects, outputs=OUTPUTS, dt_s=0.01)


@pytest.mark.parametrize(
    ("name", "values", "shapes"),
    [
        ("r_phase", {"strain": 0.05}, {"above_K": 8.0, "width_K": 6.0}),
        ("tube_friction", {"coulomb_N": 0.1}, {"sensor_on_x": 0.5}),
        ("convection_exponent", {"loss_exponent": 0.2}, {"loss_reference_K": 10.0}),
        ("ambient_drift", {"rate_K_s": 0.05}, {"bend_K_s2": 0.0, "seen": 1.0}),
        ("minor_loop", {"kappa": 0.8}, {"y_share": 1.0}),
    ],
)
def test_a_shape_that_is_not_named_is_what_was_fixed_before(name, values, shapes):
    unnamed, named = played(name, **values), played(name, **values, **shapes)
    for channel in OUTPUTS:
        np.testing.assert_array_equal(unnamed[channel], named[channel])


def test_an_r_phase_begins_and_ends_where_its_window_says():
    """Of the deflection on cooling, nothing is changed above the window."""
    hot = alternating(seconds=16.0, amps=3.6)
    plain = played(inputs=hot)
    T = plain["T_x_K"]
    cooling = np.r_[False, np.diff(T) < 0.0]
    for above in (2.0, 6.0):
        wide = played("r_phase", hot, strain=0.1, above_K=above, width_K=3.0)
        moved = np.abs(wide["true_displacement_m"] - plain["true_displacement_m"]) > 2e-5
        first = np.flatnonzero(moved & cooling)[0]
        assert T[first] <= P["martensite_start"] + above + 0.5
        assert T[first] >= P["martensite_start"] + above - 3.0


def test_a_force_sensor_on_one_side_reads_that_sides_tension_and_moves_nothing():
    rubs = {"coulomb_N": 0.1, "proportional": 0.05, "stribeck": 0.0}
    x, y, middle = (played("tube_friction", **rubs, sensor_on_x=side) for side in (1, 0, 0.5))
    for read, side in ((x, "x"), (y, "y")):
        np.testing.assert_array_equal(read["true_displacement_m"], middle["true_displacement_m"])
        np.testing.assert_allclose(read["force_N"], read[f"spring_force_{side}_N"], atol=1e-12)
    assert np.abs(x["force_N"] - y["force_N"]).max() > 0.1


def test_where_the_sensor_sits_means_nothing_without_friction():
    drags = {"viscous_drag": {"coefficient_N_s_m": 80.0}}
    sides = [
        simulate(
            P,
            DRIVE,
            effects=drags | {"tube_friction": {"coulomb_N": 0.0, "sensor_on_x": side}},
            outputs=OUTPUTS,
            dt_s=0.01,
        )["force_N"]
        for side in (0.0, 1.0)
    ]
    np.testing.assert_array_equal(*sides)


def test_a_loss_that_grows_faster_cools_what_is_hotter_than_its_reference():
    t = np.arange(4000) * 0.01
    held = Inputs(
        t, np.column_stack([np.full(t.size, 2.0), np.zeros(t.size)]), np.zeros((t.size, 2))
    )
    plain = played(inputs=held)["T_x_K"]
    assert plain[-1] > 325.0
    below = played(
        "convection_exponent", held, exponent=0.0, loss_exponent=0.5, loss_reference_K=80.0
    )
    above = played(
        "convection_exponent", held, exponent=0.0, loss_exponent=0.5, loss_reference_K=2.0
    )
    assert above["T_x_K"][-1] < plain[-1] - 0.2
    assert below["T_x_K"][-1] > plain[-1] + 0.2


def test_a_draught_bends_the_air_at_the_tubes_and_passes_the_rtd_of_the_room_by():
    plain = played()
    t = DRIVE.t_s - DRIVE.t_s[0]
    seen = played("ambient_drift", rate_K_s=0.05, bend_K_s2=-1e-3)
    rise = 0.05 * t - 1e-3 * t**2
    np.testing.assert_allclose(
        seen["rtd_ambient_degC"] - plain["rtd_ambient_degC"], rise, atol=1e-9
    )
    unseen = played("ambient_drift", rate_K_s=0.05, bend_K_s2=-1e-3, seen=0.0)
    np.testing.assert_array_equal(unseen["rtd_ambient_degC"], plain["rtd_ambient_degC"])
    np.testing.assert_array_equal(unseen["T_x_K"], seen["T_x_K"])
    assert np.abs(unseen["T_x_K"] - plain["T_x_K"]).max() > 1e-3


def test_the_resistance_of_one_spring_may_depend_on_its_phase():
    plain, of_x = played(), played("phase_resistivity", beta=-0.15, y_share=0.0)
    moved = {s: np.abs(of_x[f"v_{s}_V"] - plain[f"v_{s}_V"]).max() for s in "xy"}
    assert moved["x"] > 20.0 * moved["y"]
