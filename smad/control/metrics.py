"""How well a run went: tracking R², step response, peaks. For recorded arrays, not for the loop."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from smad.arrays import Array, Mask


def tracking_r2(reference: ArrayLike, actual: ArrayLike) -> float:
    """Coefficient of determination of `actual` as an account of `reference`, at most 1.

    1 − Σ(reference − actual)² / Σ(reference − mean)², the paper's criterion for Figs 11 and 12.
    Both of shape (n,) in the same unit. Samples without a value in both (nan) are left out; nan
    when fewer than two are left or the reference does not move.
    """
    r, y = _both(reference, actual)
    if r.size < 2:
        return math.nan
    spread = float(np.sum((r - r.mean()) ** 2))
    if spread == 0.0:
        return math.nan
    return 1.0 - float(np.sum((r - y) ** 2)) / spread


def r2_by_period(
    t_s: ArrayLike, reference: ArrayLike, actual: ArrayLike, period_s: float
) -> list[float]:
    """`tracking_r2` of each whole period, the first beginning at `t_s[0]`."""
    t = np.asarray(t_s, float)
    r, y = np.asarray(reference, float), np.asarray(actual, float)
    # Half a sample of slack: the last period of a run ends one sample short of its full time.
    slack_s = 0.5 * float(np.median(np.diff(t))) if t.size > 1 else 0.0
    periods = int((t[-1] - t[0] + 3.0 * slack_s) / period_s)
    edges = t[0] + period_s * np.arange(periods + 1) - slack_s
    return [tracking_r2(r[(t >= a) & (t < b)], y[(t >= a) & (t < b)]) for a, b in pairwise(edges)]


SETTLED = 0.05
"""Half width of the band around the target in which a response has settled, as a share."""


@dataclass(frozen=True)
class StepResponse:
    """What a step did. A time is nan when the response never got there."""

    rise_time_s: float
    """From 10 % to 90 % of the step."""
    settling_time_s: float
    """Until it stays within the band around the target for the rest of the record."""
    overshoot_fraction: float
    """Largest excess over the target as a share of the step; 0 when there is none."""


def step_response(
    t_s: ArrayLike, actual: ArrayLike, target: float, *, start: float | None = None
) -> StepResponse:
    """The response to a step to `target` asked for at `t_s[0]`, from `start` (or `actual[0]`).

    Raises ValueError when the arrays are empty or the step has no height.
    """
    t, y = _both(t_s, actual)
    if t.size == 0:
        raise ValueError("a step response needs at least one sample")
    begin = float(y[0]) if start is None else start
    height = target - begin
    if height == 0.0:
        raise ValueError(f"the step from {begin:g} to {target:g} has no height")
    share = (y - begin) / height
    tenth, ninetieth = _first_time(t, share >= 0.1), _first_time(t, share >= 0.9)
    outside = np.flatnonzero(np.abs(share - 1.0) > SETTLED)
    if outside.size == 0:
        settling = 0.0
    elif outside[-1] == t.size - 1:
        settling = math.nan
    else:
        settling = float(t[outside[-1] + 1] - t[0])
    return StepResponse(
        rise_time_s=ninetieth - tenth,
        settling_time_s=settling,
        overshoot_fraction=max(0.0, float(share.max()) - 1.0),
    )


def peak(values: ArrayLike) -> float:
    """The largest value that is not nan; nan when there is none."""
    array = np.asarray(values, float)
    return float(np.nanmax(array)) if np.isfinite(array).any() else math.nan


def _both(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    x, y = np.asarray(a, float), np.asarray(b, float)
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def _first_time(t: Array, hit: Mask) -> float:
    where = np.flatnonzero(hit)
    return float(t[where[0]]) if where.size else math.nan


RIPPLE_WINDOW_S = 5.0


def ripple(t_s: Array, signed_A: Array) -> float:
    """Standard deviation of a current, A, about a straight line through each 5 s of a hold.

    What switches and shakes, without the slow change of the current that the spring needs. Both of
    shape (n,), sampled evenly.
    """
    window = max(1, min(t_s.size, round(RIPPLE_WINDOW_S / float(np.median(np.diff(t_s))))))
    parts = np.array_split(signed_A, max(1, t_s.size // window))
    return rms(np.concatenate([_unslanted(part) for part in parts]))


def rms(values: Array) -> float:
    """Root mean square of the values that are not nan."""
    return math.sqrt(float(np.nanmean(values * values)))


def _unslanted(values: Array) -> Array:
    """`values` less the straight line that fits them best."""
    x = np.arange(values.size) - 0.5 * (values.size - 1)
    level = values - values.mean()
    slope = float(x @ level) / max(float(x @ x), 1.0)
    return np.asarray(level - slope * x, float)


def starts(duty: ArrayLike) -> int:
    """How often a pump went from rest to running."""
    on = np.asarray(duty, float) > 0.0
    return int(np.count_nonzero(on[1:] & ~on[:-1]))
