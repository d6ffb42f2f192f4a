"""The Silverbox as a linear resonator, and eleven things that it may do beside.

Published (Wigren and Schoukens, ECC 2013, equations 13 and 14): m·y″ + d·y′ + (a + b·y²)·y = u.
The model given here has b = 0. In its units, x = y, w = y′/ω₀ and f = gain·u, all in volts:
x′ = ω₀·w, w′ = ω₀·(f − x − 2ζ·w), to which each effect adds a term.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from smad.diagnosis.plant import Channel, Effect, EffectParameter, Parameter, Signal, Traits

RATE_HZ = 1e7 / 2**14
"""Samples a second (equation 12)."""
_FINER = 8
"""Input samples to a recorded one: two to a step of the solver, four steps to a sample."""


def _effect(name: str, title: str, unit: str, high: float, *, low: float = 0.0) -> Effect:
    size = EffectParameter(name="size", unit=unit, typical=high / 10, low=low, high=high)
    return Effect(name=name, title=title, parameters=(size,), signals=("output_V",))


_EFFECTS = (
    _effect("cubic_spring", "stiffness that grows with y²", "1/V²", 20.0, low=-20.0),
    _effect("quadratic_spring", "stiffness that grows with y", "1/V", 3.0, low=-3.0),
    _effect("fifth_order_spring", "stiffness that grows with y⁴", "1/V⁴", 400.0, low=-400.0),
    _effect("spring_play", "play before the spring acts", "V", 0.1),
    _effect("soft_stop", "a second spring from 0.1 V on", "V/V", 4.0),
    _effect("coulomb_friction", "friction of constant size", "V", 0.05),
    _effect("quadratic_damping", "damping with the square of the rate", "1/V", 5.0),
    _effect("swing_damping", "damping that grows with y²", "1/V²", 20.0, low=-20.0),
    _effect("input_bend", "an input gain that changes with u²", "1/V²", 40.0, low=-40.0),
    _effect("output_bend", "an output gain that changes with y²", "1/V²", 5.0, low=-5.0),
    _effect("sensor_lag", "an output that is measured late", "s", 3e-3),
)


@dataclass(frozen=True)
class Silverbox:
    """Input and output in volts, sampled at 610.35 Hz, from rest to rest."""

    name: str = "Silverbox"
    version: str = "1"
    traits = Traits(shortest_s=1.0)  # its resonance goes through 68 periods in a second
    inputs = (Signal("input_V", "V", -0.2, 0.2),)
    channels = (Channel(name="output_V", unit="V", quantum=1e-5, low=-0.5, high=0.5, noise=1e-3),)
    parameters = (
        Parameter(name="resonance_Hz", unit="Hz", nominal=70.0, low=50.0, high=90.0, prior_sd=5.0),
        Parameter(name="damping_ratio", unit="1", nominal=0.05, low=0.01, high=0.2, prior_sd=0.02),
        Parameter(name="gain", unit="V/V", nominal=1.0, low=0.3, high=3.0, prior_sd=0.3),
        Parameter(name="input_zero_V", unit="V", nominal=0.0, low=-0.02, high=0.02, prior_sd=5e-3),
        Parameter(name="output_zero_V", unit="V", nominal=0.0, low=-0.02, high=0.02, prior_sd=5e-3),
    )
    effects = _EFFECTS

    def simulate(self, point, run, *, fast=False):
        theta = np.array([point.theta.get(p.name, p.nominal) for p in self.parameters])
        sizes = [point.effects.get(e.name, {}).get("size", 0.0) for e in self.effects]
        # Nothing above a third of the rate was played, so that the input between its samples is
        # known; runs begin and end at rest, which a Fourier series takes for granted.
        spectrum = np.fft.rfft(run.inputs["input_V"])
        finer = np.fft.irfft(spectrum, _FINER * len(run.t_s)) * _FINER
        course = _replay(finer, 2.0 / (_FINER * RATE_HZ), theta, np.array(sizes))
        return {"output_V": course}

    def regimes(self, run, side):
        square = np.convolve(run.outputs["output_V"] ** 2, np.full(16, 1 / 16), "same")
        large = square > 0.05**2
        return {"rest": np.zeros(len(large), dtype=bool), "small": ~large, "large": large}


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
