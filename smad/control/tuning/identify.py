"""Models from the recorded samples of the experiment, and the reasons not to trust them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smad.arrays import Array
from smad.control.tuning.errors import TuningError
from smad.control.tuning.rules import Lag

LAGS_S = (0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6, 2.4)
LONGEST_DELAY_S = 0.3
LEAST_DELAY_SAMPLES = 1.0
"""Half a sample the setpoint is held, and about as long it is on its way: no fit finds less."""
LEFT_OUT = 0.05
"""Share of the samples at the beginning that only fill the delay."""
LEAST_FIT = 0.9
MOST_DRIFT_PER_S = {"displacement_mm": 0.02, "temperature": 0.3}
LEAST_PULL_MM = 0.3
SATURATED_A = 0.1
"""An applied current that stays so far below the asked one was held back."""


@dataclass(frozen=True)
class Stillness:
    """What a sensor shows at rest: noise (RMS), smallest step."""

    noise: float
    count: float


def stillness(t_s: ArrayLike, values: ArrayLike, what: str, most_drift_per_s: float) -> Stillness:
    """How still a quantity is at rest. Raises TuningError without readings, or when it drifts."""
    t, y = np.asarray(t_s, float), np.asarray(values, float)
    good = np.isfinite(y)
    if good.sum() < 10:
        raise TuningError(
            f"the bench has no reading of the {what}",
            value=f"{good.sum()} valid samples of {y.size}",
            action="connect the sensor; tuning needs it",
        )
    t, y = t[good], y[good]
    slope, level = np.polyfit(t - t.mean(), y, 1)
    if abs(slope) > most_drift_per_s:
        raise TuningError(
            f"the {what} drifts before anything is driven",
            value=f"{slope:.3g} per second",
            limit=f"{most_drift_per_s:g} per second",
            action="let the springs and the water come to rest, and look for slack in the sensor",
        )
    steps = np.diff(np.unique(np.round(y, 9)))
    rest = y - level - slope * (t - t.mean())
    return Stillness(float(np.sqrt(np.mean(rest**2))), float(steps.min()) if steps.size else 0.0)


def pulled(
    t_s: ArrayLike, values: ArrayLike, current_A: ArrayLike, asked_A: ArrayLike, what: str
) -> Lag:
    """The model of one direction from the samples of its pulses; `values` grow with the current.

    A lag with delay is fitted to the answer to the squared current, beside a cubic in time for what
    warms up slowly. Raises TuningError when the current was held back, nothing moved, or no such
    model accounts for what was seen.
    """
    t, y = np.asarray(t_s, float), np.asarray(values, float)
    i, commanded = np.asarray(current_A, float), np.asarray(asked_A, float)
    # A sample that was passed over has no answer of its own.
    commanded = np.where(np.isfinite(commanded), commanded, i)
    good = np.isfinite(y) & np.isfinite(i)
    t, y, i, commanded = t[good], y[good], i[good], commanded[good]
    if t.size < 50:
        raise TuningError(
            f"{what}: the pulses ended early",
            value=f"{t.size} samples",
            action="look at the run log for a limit that acted",
        )
    held_back = float(np.mean(commanded - i > SATURATED_A))
    if held_back > 0.1:
        raise TuningError(
            f"{what}: the current is saturated",
            value=f"held back in {held_back:.0%} of the samples",
            limit="10 %",
            action="check supply, limits and heater, or lower control.current_limit_A",
        )
    period_s = float(np.median(np.diff(t)))
    # What was asked for, not what was applied: the way to the board is part of the delay.
    square = commanded * commanded
    at_A = 0.5 * (float(np.quantile(i, 0.1)) + float(np.quantile(i, 0.9)))
    best: tuple[float, float, float, float, float] | None = None
    clock = (t - t[0]) / (t[-1] - t[0])
    later = clock > LEFT_OUT
    cubic = np.column_stack([clock**k for k in range(4)])[later]
    for lag_s in LAGS_S:
        # What the lag remembers of before the first sample decays with it.
        base = np.column_stack([cubic, np.exp(-(t - t[0]) / lag_s)[later]])
        slow = _beside(base, y[later])
        for delay_s in np.arange(0.0, LONGEST_DELAY_S, 0.5 * period_s):
            late = np.interp(t - delay_s, t, square - square.mean())
            answer = _beside(base, _lagged(late, lag_s, period_s)[later])
            gain = float(answer @ slow) / max(float(answer @ answer), 1e-30)
            residual = float(np.mean((slow - gain * answer) ** 2))
            if best is None or residual < best[0]:
                best = (residual, float(delay_s), lag_s, gain, float(np.mean(slow**2)))
    assert best is not None
    residual, delay_s, lag_s, gain, whole = best
    fit = 1.0 - residual / max(whole, 1e-30)
    if gain <= 0.0 or fit < LEAST_FIT:
        raise TuningError(
            f"{what}: what is measured does not follow the current",
            value=f"a lag with delay accounts for {max(0.0, fit):.0%} of the answer",
            limit=f"at least {LEAST_FIT:.0%}",
            action="look at the run log: is the spring warm enough to pull, is the sensor loose?",
        )
    delay_s = max(delay_s, LEAST_DELAY_SAMPLES * period_s)
    return Lag(gain * 2.0 * at_A, lag_s, delay_s, at_A, fit)


def _beside(base: Array, values: Array) -> Array:
    """What of `values` no combination of the columns of `base` accounts for."""
    return np.asarray(values - base @ np.linalg.lstsq(base, values, rcond=None)[0], float)


def _lagged(values: Array, lag_s: float, period_s: float) -> Array:
    """The integral of `values`, forgotten with `lag_s`."""
    from scipy.signal import lfilter

    keep = math.exp(-period_s / lag_s)
    return np.asarray(lfilter([0.0, period_s], [1.0, -keep], values), float)


@dataclass(frozen=True)
class Cooling:
    """How water cools a spring: time constant towards the water, s, and where it began, K above."""

    time_s: float
    from_K: float


def cooled(t_s: ArrayLike, spring_degC: ArrayLike, inlet_degC: ArrayLike, what: str) -> Cooling:
    """How fast water cools. Raises TuningError when it does not."""
    t, warm = np.asarray(t_s, float), np.asarray(spring_degC, float)
    inlet = np.asarray(inlet_degC, float)
    water = float(np.nanmedian(inlet)) if np.isfinite(inlet).any() else float(np.nanmin(warm))
    above = warm - water
    if above.size < 10 or not np.isfinite(above).all() or above[0] <= 0.0:
        raise TuningError(
            f"{what}: there was nothing to cool",
            value=f"{above.size} samples",
            action="check the temperature sensors",
        )
    tenth = max(2, above.size // 10)
    first, last = float(np.mean(above[:tenth])), float(np.mean(above[-tenth:]))
    if not last < 0.8 * first:
        raise TuningError(
            f"{what}: water does not cool the spring",
            value=f"from {first:.1f} to {last:.1f} K above the water in {t[-1] - t[0]:.0f} s",
            limit="a fall by a fifth",
            action="check pump, hose and valve before tuning",
        )
    time_s = (t[-1] - t[0]) * (1.0 - 1.0 / (above.size / tenth)) / math.log(first / max(last, 0.05))
    return Cooling(float(time_s), first)
