"""The Silverbox as a linear resonator, with the effects that it may have.

Published (Wigren and Schoukens, ECC 2013, equations 13 and 14): m·y″ + d·y′ + (a + b·y²)·y = u.
The model given here has b = 0. In its units, x = y, w = y′/ω₀ and f = gain·u, all in volts:
x′ = ω₀·w, w′ = ω₀·(f − x − 2ζ·w), to which each effect adds a term.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy.signal import resample_poly

from smad.simulators import simulator

_FINER = 8
"""Steps of the solver to a sample."""


@numba.njit(nogil=True)
def _swing(
    volts,
    dt,
    start_V,
    rate_V_s,
    resonance_Hz,
    damping_ratio,
    gain,
    input_zero_V,
    output_zero_V,
    cubic_spring,
    square_spring,
    soft_stop,
    friction_V,
    square_damping,
):
    step = dt * 2.0 * np.pi * resonance_Hz
    shown = np.empty(len(volts))
    x, w = start_V - output_zero_V, rate_V_s * dt / step
    for k in range(len(volts)):
        shown[k] = x + output_zero_V
        force = gain * (volts[k] - input_zero_V)
        force -= x * (1.0 + square_spring * x + cubic_spring * x * x)
        force -= soft_stop * (x - min(max(x, -0.1), 0.1))
        force -= (2.0 * damping_ratio + square_damping * abs(w)) * w
        w += step * force
        w -= min(max(w, -step * friction_V), step * friction_V)
        x += step * w
    return shown


def _circuit(t, inputs, values, start):
    # Nothing above a third of the rate was played, so that the input between its samples is known.
    finer = resample_poly(inputs["input_V"], _FINER, 1)
    begun = start["output_V"], start["output_V_rate"]
    return {"output_V": _swing(finer, t[1] / _FINER, *begun, **values)[::_FINER]}


SILVERBOX = simulator(
    _circuit,
    name="Silverbox",
    parameters={
        "resonance_Hz": (70.0, 50.0, 90.0),
        "damping_ratio": (0.05, 0.01, 0.2),
        "gain": (1.0, 0.3, 3.0),
        "input_zero_V": (0.0, -0.02, 0.02),
        "output_zero_V": (0.0, -0.02, 0.02),
    },
    effects={
        "cubic_spring": (2.0, -20.0, 20.0),
        "square_spring": (0.3, -3.0, 3.0),
        "soft_stop": (0.4, 0.0, 4.0),
        "friction_V": (0.005, 0.0, 0.05),
        "square_damping": (0.5, 0.0, 5.0),
    },
)
