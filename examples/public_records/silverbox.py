"""The Silverbox as a linear resonator, and eleven things that it may do beside.

Published (Wigren and Schoukens, ECC 2013, equations 13 and 14): m·y″ + d·y′ + (a + b·y²)·y = u.
The model given here has b = 0. In its units, x = y, w = y′/ω₀ and f = gain·u, all in volts:
x′ = ω₀·w, w′ = ω₀·(f − x − 2ζ·w), to which each effect adds a term.
"""

from __future__ import annotations

import numba
import numpy as np

from smad.simulators import Missing, simulator

RATE_HZ = 1e7 / 2**14
"""Samples a second (equation 12)."""
_FINER = 8
"""Input samples to a recorded one: two to a step of the solver, four steps to a sample."""


def _size(title: str, unit: str, high: float, *, low: float = 0.0) -> Missing:
    return Missing(typical=high / 10, low=low, high=high, title=title, unit=unit)


_EFFECTS = {
    "cubic_spring": _size("stiffness that grows with y²", "1/V²", 20.0, low=-20.0),
    "quadratic_spring": _size("stiffness that grows with y", "1/V", 3.0, low=-3.0),
    "fifth_order_spring": _size("stiffness that grows with y⁴", "1/V⁴", 400.0, low=-400.0),
    "spring_play": _size("play before the spring acts", "V", 0.1),
    "soft_stop": _size("a second spring from 0.1 V on", "V/V", 4.0),
    "coulomb_friction": _size("friction of constant size", "V", 0.05),
    "quadratic_damping": _size("damping with the square of the rate", "1/V", 5.0),
    "swing_damping": _size("damping that grows with y²", "1/V²", 20.0, low=-20.0),
    "input_bend": _size("an input gain that changes with u²", "1/V²", 40.0, low=-40.0),
    "output_bend": _size("an output gain that changes with y²", "1/V²", 5.0, low=-5.0),
    "sensor_lag": _size("an output that is measured late", "s", 3e-3),
}
_PARAMETERS = {
    "resonance_Hz": (70.0, 50.0, 90.0, 5.0),
    "damping_ratio": (0.05, 0.01, 0.2, 0.02),
    "gain": (1.0, 0.3, 3.0, 0.3),
    "input_zero_V": (0.0, -0.02, 0.02, 5e-3),
    "output_zero_V": (0.0, -0.02, 0.02, 5e-3),
}


def _circuit(t, inputs, values, start):
    theta = np.array([values[n] for n in _PARAMETERS])
    sizes = np.array([values[n] for n in _EFFECTS])
    # Nothing above a third of the rate was played, so that the input between its samples is known;
    # runs begin and end at rest, which a Fourier series takes for granted.
    finer = np.fft.irfft(np.fft.rfft(inputs["input_V"]), _FINER * len(t)) * _FINER
    return {"output_V": _replay(finer, 2.0 / (_FINER * RATE_HZ), theta, sizes)}


SILVERBOX = simulator(
    _circuit,
    name="Silverbox",
    parameters=_PARAMETERS,
    effects=_EFFECTS,
    shortest_s=1.0,  # its resonance goes through 68 periods in a second
)


@numba.njit(nogil=True)
def _rates(x, w, u, theta, sizes):
    resonance, damping, gain, input_zero, _ = theta
    cubic, quadratic, fifth, play, stop, friction, drag, swing, input_bend, _, _ = sizes
    u -= input_zero
    force = gain * u * (1.0 - input_bend * u * u)
    spring = x if play == 0.0 else x - min(max(x, -play), play)
    force -= spring * (1.0 + quadratic * x + cubic * x * x + fifth * x**4)
    if abs(x) > 0.1:
        force -= stop * (x - 0.1 * np.sign(x))
    force -= w * (2.0 * damping + drag * abs(w) + swing * x * x)
    if friction != 0.0:
        force -= friction * np.tanh(w / 0.002)
    omega = 2.0 * np.pi * resonance
    return omega * w, omega * force


@numba.njit(nogil=True)
def _replay(finer, step_s, theta, sizes):
    n = len(finer) // _FINER
    course = np.empty(n)
    x = w = shown = 0.0
    output_bend, lag_s = sizes[-2:]
    keep = 0.0 if lag_s == 0.0 else np.exp(-step_s / lag_s)
    for k in range(n):
        course[k] = shown * (1.0 - output_bend * shown * shown) + theta[4]
        for i in range(k * _FINER, (k + 1) * _FINER, 2):
            before, middle, after = finer[i], finer[i + 1], finer[(i + 2) % len(finer)]
            a, b = _rates(x, w, before, theta, sizes)
            half = step_s / 2
            c, d = _rates(x + half * a, w + half * b, middle, theta, sizes)
            e, f = _rates(x + half * c, w + half * d, middle, theta, sizes)
            g, h = _rates(x + step_s * e, w + step_s * f, after, theta, sizes)
            x += step_s / 6 * (a + 2 * c + 2 * e + g)
            w += step_s / 6 * (b + 2 * d + 2 * f + h)
            # A model that runs away must lose, and must not stop the fit.
            x, w = min(max(x, -5.0), 5.0), min(max(w, -5.0), 5.0)
            shown = keep * shown + (1.0 - keep) * x
    return course
