"""A positioning drive as a mass with drag that a motor pushes, with the effects that it may have.

Published (Janot, Gautier and Brunot, Workshop on Nonlinear System Identification Benchmarks 2019,
equations 1 and 12): M·x″ + F·x′ + Fc·sign(x′) + offset = force, and F is smaller forwards.
The model given here has no Fc, and one F.

The drive was in a closed loop. The input here is the force that its motor was told to give, so that
no model of the controller is needed.
The output is the central difference of the recorded position. In the position, errors of the
modelled force add up: after some seconds model and drive move apart. An error of the speed decays
within mass/drag, half a second.
The output's name ends in "_rate": a law may use the sign of such a state only.
"""

from __future__ import annotations

import numba
import numpy as np

from smad.simulators import simulator


@numba.njit(nogil=True)
def _rates(
    force,
    dt,
    rate,
    mass_kg,
    drag_N_s_m,
    offset_N,
    friction_N,
    fading_friction_N,
    one_way_drag_N_s_m,
    square_drag,
    dead_zone_N,
):
    shown = np.empty(len(force))
    for k in range(len(force)):
        shown[k] = rate
        push = force[k] - min(max(force[k], -dead_zone_N), dead_zone_N) - offset_N
        push -= (drag_N_s_m + square_drag * abs(rate)) * rate
        push -= one_way_drag_N_s_m * abs(rate) / 2.0
        rate += dt / mass_kg * push
        # Friction takes speed off, and holds what it can stop.
        stop = dt / mass_kg * (friction_N + fading_friction_N * np.exp(-((rate / 0.01) ** 2)))
        rate -= min(max(rate, -stop), stop)
    return shown


def _drive(t, inputs, values, start):
    # A run begins in motion, with the rate that it shows first.
    return {"position_rate": _rates(inputs["force_N"], t[1], start["position_rate"], **values)}


EMPS = simulator(
    _drive,
    name="positioning drive",
    parameters={
        "mass_kg": (100.0, 50.0, 200.0),
        "drag_N_s_m": (300.0, 10.0, 1000.0),
        "offset_N": (0.0, -20.0, 20.0),
    },
    effects={
        "friction_N": (15.0, 0.0, 60.0),
        "fading_friction_N": (15.0, 0.0, 60.0),
        "one_way_drag_N_s_m": (50.0, -200.0, 200.0),
        "square_drag": (1000.0, 0.0, 4000.0),
        "dead_zone_N": (10.0, 0.0, 40.0),
    },
    units={"position_rate": "m/s"},
    transducers=True,
)
