"""Two cascaded tanks with free outlets, with the effects that they may have.

Published (Wigren and Schoukens, ECC 2013, equation 7): x₁′ = −k₁·√x₁ + k₄·u, x₂′ = k₂·√x₁ − k₃·√x₂,
and of this record (doi 10.4121/12960104): above its rim the upper tank spills, in part into the
lower one. The model given here has no rims.
Levels are in volts of the sensor, which is not calibrated, and which ends at 10 V. The upper level
is not measured; k₂ = k₁ sets its unit: what leaves the upper tank arrives in the lower.
"""

from __future__ import annotations

import numba
import numpy as np

from smad.simulators import Missing, simulator

_FINER = 8
"""Steps of the solver to a sample."""


@numba.njit(nogil=True)
def _levels(
    volts,
    dt,
    upper_outlet,
    lower_outlet,
    pump,
    upper_start_V,
    lower_start_V,
    sensor_zero_V,
    upper_overflow,
    upper_rim_V,
    to_lower,
    lower_overflow,
    lower_rim_V,
    upper_leak,
    lower_leak,
    splash,
):
    shown = np.empty(len(volts))
    upper, lower = upper_start_V, lower_start_V - sensor_zero_V
    for k in range(len(volts)):
        shown[k] = min(lower + sensor_zero_V, 10.0)
        for _ in range(_FINER):
            inflow = pump * volts[k]
            down = upper_outlet * np.sqrt(upper)
            out = lower_outlet * np.sqrt(lower) + lower_leak * lower
            upper += dt * ((1.0 - splash) * inflow - down - upper_leak * upper)
            over = upper_overflow * max(upper - upper_rim_V, 0.0)
            lower += dt * (down + splash * inflow - out) + to_lower * over
            upper, lower = max(upper - over, 0.0), max(lower, 0.0)
            lower -= lower_overflow * max(lower - lower_rim_V, 0.0)
    return shown


def _tanks(t, inputs, values, start):
    return {"level_V": _levels(inputs["pump_V"], t[1] / _FINER, **values)}


TANKS = simulator(
    _tanks,
    name="cascaded tanks",
    parameters={
        "upper_outlet": (0.05, 0.01, 0.2),
        "lower_outlet": (0.05, 0.01, 0.2),
        "pump": (0.05, 0.01, 0.2),
        "upper_start_V": (5.0, 0.5, 35.0),
        "lower_start_V": (5.0, 3.0, 7.0),
        "sensor_zero_V": (0.0, -3.0, 3.0),
    },
    effects={
        "upper_overflow": Missing(
            typical=0.25,
            high=1.0,
            shapes={"upper_rim_V": (15.0, 2.0, 40.0), "to_lower": (0.5, 0.0, 1.0)},
        ),
        "lower_overflow": Missing(
            typical=0.25, high=1.0, shapes={"lower_rim_V": (10.0, 5.0, 20.0)}
        ),
        "upper_leak": (0.005, 0.0, 0.02),
        "lower_leak": (0.005, 0.0, 0.02),
        "splash": (0.2, 0.0, 0.9),
    },
    transducers=True,
)
