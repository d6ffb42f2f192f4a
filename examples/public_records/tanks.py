"""Two cascaded tanks with free outlets, and twelve things that they may do beside.

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

STEP_S = 4.0
END_V = 10.0
_FINER = 8


_PUMP, _SENSOR = ("input_pump_V",), ("reading_level_V",)


def _size(title, unit, high, *, low=0.0, places=(), **shapes) -> Missing:
    return Missing(
        typical=high / 4, low=low, high=high, title=title, unit=unit, shapes=shapes, places=places
    )


_EFFECTS = {
    "upper_overflow": _size("the upper tank spills over its rim", "1", 1.0,
                            upper_rim_V=(15.0, 2.0, 40.0), to_lower=(0.5, 0.0, 1.0)),
    "lower_overflow": _size("the lower tank spills over its rim", "1", 1.0,
                            lower_rim_V=(10.0, 5.0, 20.0)),
    "upper_leak": _size("the upper tank leaks in proportion to its level", "1/s", 0.02),
    "lower_leak": _size("the lower tank leaks in proportion to its level", "1/s", 0.02),
    "upper_power": _size("outflow above with another power than ½", "1", 0.45, low=-0.45),
    "lower_power": _size("outflow below with another power than ½", "1", 0.45, low=-0.45),
    "pump_bend": _size("the pump's gain changes with its voltage", "1/V", 0.12, low=-0.12,
                       places=_PUMP),
    "pump_dead_zone": _size("no flow below a voltage", "V", 2.0, places=_PUMP),
    "pump_lag": _size("the pump follows late", "s", 120.0, places=_PUMP),
    "sensor_lag": _size("the level is shown late", "s", 120.0, places=_SENSOR),
    "sensor_bend": _size("the sensor's gain changes with the level", "1/V", 0.05, low=-0.05,
                         places=_SENSOR),
    "splash": _size("a share of the inflow goes straight to the lower tank", "1", 0.9),
}  # fmt: skip
_PARAMETERS = {
    "upper_outlet": (0.05, 0.01, 0.2, 0.02),
    "lower_outlet": (0.05, 0.01, 0.2, 0.02),
    "pump": (0.05, 0.01, 0.2, 0.02),
    "upper_start_V": (5.0, 0.5, 35.0, 5.0),
    "lower_start_V": (5.0, 3.0, 7.0, 0.5),
    "sensor_zero_V": (0.0, -3.0, 3.0, 1.0),
}


def _tanks(t, inputs, values, start):
    theta = np.array([values[n] for n in _PARAMETERS])
    rest = np.array([values[n] for n in values if n not in _PARAMETERS])
    return {"level_V": _replay(inputs["pump_V"], STEP_S / _FINER, theta, rest)}


TANKS = simulator(_tanks, name="cascaded tanks", parameters=_PARAMETERS, effects=_EFFECTS)


@numba.njit(nogil=True)
def _replay(pump, step_s, theta, values):
    k_upper, k_lower, k_pump, upper, lower, zero = theta
    upper_spill, upper_rim, to_lower, lower_spill, lower_rim = values[:5]
    upper_leak, lower_leak, upper_power, lower_power = values[5:9]
    pump_bend, dead_zone, pump_lag, sensor_lag, bend, splash = values[9:]
    course = np.empty(len(pump))
    lower -= zero
    shown, turning = lower, pump[0]
    for k in range(len(pump)):
        seen = shown * (1.0 - bend * shown) + zero
        course[k] = min(seen, END_V)
        for _ in range(_FINER):
            turning += (pump[k] - turning) * (
                1.0 if pump_lag == 0.0 else 1.0 - np.exp(-step_s / pump_lag)
            )
            driving = max(turning - dead_zone, 0.0)
            inflow = k_pump * driving * (1.0 - pump_bend * driving)
            down = k_upper * upper ** (0.5 + upper_power)
            out = k_lower * lower ** (0.5 + lower_power)
            out += lower_leak * lower
            upper += step_s * ((1.0 - splash) * inflow - down - upper_leak * upper)
            over = upper_spill * max(upper - upper_rim, 0.0)
            lower += step_s * (down + splash * inflow - out) + to_lower * over
            upper, lower = max(upper - over, 0.0), max(lower, 0.0)
            lower -= lower_spill * max(lower - lower_rim, 0.0)
            shown += (lower - shown) * (
                1.0 if sensor_lag == 0.0 else 1.0 - np.exp(-step_s / sensor_lag)
            )
    return course
