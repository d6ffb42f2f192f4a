"""Gains from a model, and what is left to instability with them.

The model of a direction is gain/(s + 1/lag)·exp(-delay·s), from current to displacement or
temperature: a lag that crosses over far above 1/lag acts as an integrator.

The rule is the internal-model (lambda) rule for a lag with delay: kp = 1/(gain·(tc + delay)),
ki = kp/lag. Rivera, Morari, Skogestad, Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252; with
tc = delay as the tight choice of Skogestad, J. Process Control 13 (2003) 291.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

NOISE_A = {"displacement": 0.2, "temperature": 0.05}
"""The noise of the sensor may shake the current by so much, RMS, by loop. A quiet hold has a band
against it, which leaves the displacement loop more while it moves; a temperature is held without.
"""


@dataclass(frozen=True)
class Lag:
    """How a quantity follows the current: `gain` in its unit per ampere and second, at the current
    `at_A`; times in s. `fit` is the share of the variation that the model accounts for."""

    gain: float
    lag_s: float
    delay_s: float
    at_A: float
    fit: float

    def scaled_to(self, current_A: float) -> Lag:
        """The same at another current: heat goes with its square, so the gain with itself."""
        return Lag(self.gain * current_A / self.at_A, self.lag_s, self.delay_s, current_A, self.fit)


@dataclass(frozen=True)
class Gains:
    """Gains of a PI loop, in A per unit, and per unit and second."""

    kp: float
    ki: float


@dataclass(frozen=True)
class Margins:
    """What the loop can bear: a gain larger by a factor, a delay longer by some seconds."""

    gain: float
    delay_s: float
    phase_deg: float


def gains_for(model: Lag, noise: float, noise_A: float) -> Gains:
    """Gains by the rule, no tighter than the noise of the sensor (RMS, in its unit) allows.

    It may shake the current by `noise_A`, RMS.
    """
    tightest = 1.0 / (model.gain * 2.0 * model.delay_s)
    kp = min(tightest, noise_A / noise if noise > 0.0 else math.inf)
    return Gains(_two_digits(kp), _two_digits(kp / model.lag_s))


def margins_of(model: Lag, gains: Gains) -> Margins:
    """Margins of the loop of `gains` and `model`, from its open-loop frequency response."""

    def loop(w: float) -> complex:
        s = complex(0.0, w)
        return (gains.kp + gains.ki / s) * model.gain / (s + 1.0 / model.lag_s)

    crossover = _root(lambda w: abs(loop(w)) - 1.0, 1e-4, 1e5)
    phase = math.pi + cmath.phase(loop(crossover)) - crossover * model.delay_s

    def total_phase(w: float) -> float:
        return cmath.phase(loop(w)) - w * model.delay_s + math.pi

    turning = _root(total_phase, 1e-4, 1e6)
    return Margins(1.0 / abs(loop(turning)), phase / crossover, math.degrees(phase))


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    """Where the falling function `f` passes zero between two frequencies, by halving in log."""

    for _ in range(200):
        middle = math.sqrt(low * high)
        if f(middle) > 0.0:
            low = middle
        else:
            high = middle
    return math.sqrt(low * high)


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def band_mm(count_mm: float, noise_mm: float, period_s: float, smooth_s: float) -> float:
    """The band of a quiet hold: two counts and six standard deviations of the smoothed noise."""
    smoothed_mm = noise_mm * math.sqrt(period_s / (period_s + 2.0 * smooth_s))
    return math.ceil(1e3 * (2.0 * count_mm + 6.0 * smoothed_mm)) * 1e-3
