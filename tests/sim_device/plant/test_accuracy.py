"""Accuracy: convergence as the step shrinks, and an independent solution by solve_ivp."""

import numpy as np
import pytest

from bench.reference import Reference
from sim_device.plant import Inputs, load_parameters, simulate
from tests.sim_device.plant.cases import alternating

KEPT = ("displacement_m", "force_N", "T_x_K", "T_y_K", "xi_S_x", "xi_T_x")


def worst(out, reference, y):
    """Largest difference in displacement (m), force (N), temperature (K) and fraction."""
    return (
        np.abs(out["displacement_m"] - reference.displacement(y)).max(),
        np.abs(out["force_N"] - reference.force(y)).max(),
        max(np.abs(out["T_x_K"] - y[0]).max(), np.abs(out["T_y_K"] - y[4]).max()),
        np.abs(out["xi_S_x"] + out["xi_T_x"] - y[2] - y[3]).max(),
    )


@pytest.mark.parametrize(("name", "amps", "heat_s"), [("A", 3.6, 5.0), ("B", 4.0, 6.0)])
def test_solve_ivp_gives_the_same_run_within_what_the_sensors_resolve(name, amps, heat_s):
    parameters = load_parameters(name)
    inputs = alternating(amps=amps, heat_s=heat_s)
    reference = Reference.make(parameters)
    y = reference.solve(inputs.t_s, inputs.rows[:, :4], rtol=1e-8, atol=1e-11, max_step=0.01)
    assert reference.displacement(y).max() > 8e-3
    assert reference.displacement(y).min() < -6e-3
    for step_s, (u, F, T, xi) in {
        1e-3: (1e-6, 1e-4, 1e-3, 5e-5),
        1e-2: (5e-6, 3e-4, 1e-2, 2e-4),
    }.items():
        out = simulate(parameters, inputs, dt_s=step_s, outputs=KEPT)
        du, dF, dT, dxi = worst(out, reference, y)
        assert du < u
        assert dF < F
        assert dT < T
        assert dxi < xi


def test_without_switching_events_the_kernel_and_solve_ivp_agree_to_nanometres():
    parameters = load_parameters("A")
    t = np.arange(600) * 0.01
    i_A = np.column_stack([np.where(t > 0, 2.5, 0.0), 0 * t])
    inputs = Inputs(t, i_A, 0 * i_A)
    reference = Reference.make(parameters)
    y = reference.solve(t, inputs.rows[:, :4], rtol=1e-10, atol=1e-13, max_step=0.005)
    out = simulate(parameters, inputs, dt_s=2.5e-4, outputs=KEPT)
    du, dF, dT, dxi = worst(out, reference, y)
    assert du < 5e-9
    assert dF < 3e-7
    assert dT < 5e-6
    assert dxi < 1e-6


def orders(inputs, steps=(8e-3, 4e-3, 2e-3, 1e-3)):
    """Observed order between successive steps, in temperature and in displacement."""
    parameters = load_parameters("A")
    exact = simulate(parameters, inputs, dt_s=min(steps) / 32, outputs=KEPT)
    found = []
    for name in ("T_x_K", "displacement_m"):
        errors = []
        for step_s in steps:
            out = simulate(parameters, inputs, dt_s=step_s, outputs=KEPT)
            errors.append(np.sqrt(np.mean((out[name] - exact[name]) ** 2)))
        found.append(np.log(errors[0] / errors[-1]) / np.log(steps[0] / steps[-1]))
    return found


def test_a_smooth_run_converges_with_second_order():
    t = np.arange(100) * 0.08
    current = 1.9 * (1 - np.cos(2 * np.pi * t / t[-1]))
    i_A = np.column_stack([current, 0 * t])
    in_T, in_u = orders(Inputs(t, i_A, 0 * i_A))
    assert in_T > 1.7
    assert in_u > 1.5


def test_a_run_with_pumps_switches_and_detwinning_converges_with_first_order():
    in_T, in_u = orders(alternating(seconds=30.0, step_s=0.04), steps=(4e-3, 1e-3, 2.5e-4))
    assert in_T > 0.85
    assert in_u > 0.85
