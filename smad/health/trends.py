"""What changed in a series, since when, and when it will reach a limit. Pure.

Change: a two-sided cumulative sum (E. S. Page, Biometrika 41, 1954)

    S⁺_k = max(0, S⁺_{k−1} + u_k − K),   S⁻_k = max(0, S⁻_{k−1} − u_k − K),

noticed when either exceeds H. It stays there until it falls to 0: the series has come back.
|u_k| ≤ C, since an odd row is no change (J. M. Lucas, R. B. Crosier, Comm. Statist. 11, 1982).

With mean m and scatter s of the first n rows (y_k − m) / (s √(1+1/n)) has Student's t distribution
with n − 1 degrees of freedom while nothing changes; u_k is the normal deviate of the same
probability, so that a scatter known from ten rows alone gives no false alarms. The scatter that
counts is that between rows begun from rest, runs or blocks; cycles of one block differ less
(S. J. Janis, Is your process too good for its control limits?, ASQC 1990).

Forecast: the line y = a + b x by least squares since the change; it crosses the limit L at
x = (L − a) / b, with Fieller's interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
REFERENCE = 10
"""The first so many rows are the bench as it was."""
LEAST_ROWS = REFERENCE + 2
SLACK = 1.25
"""K: the mean of ten rows is itself uncertain by a third of s."""
THRESHOLD = 7.0
"""H. With K and C: of series of 41 rows in which nothing changes 1 in 1000 changes or comes back."""
CAP = 3.25
"""C: with K and H, three rows far out are no change and four are."""
LEAST_SCATTER = 1e-3
"""s is at least this share of the mean: readings have digits."""


@dataclass(frozen=True, kw_only=True)
class Trend:
    """One series. `noticed` is the place of the row at which a change was noticed, None: none.

    `passed` are the rows at which earlier changes were noticed, and at which each had come back.
    `since` is the row from which the cumulative sum rose: about where the change began. `band` is
    mean ± 3 scatters of the reference. `slope` and its standard error are per unit of x, since the
    change or over all rows.
    """

    name: str
    x: Array
    y: Array
    mean: float
    scatter: float
    noticed: int | None
    since: int | None
    passed: tuple[tuple[int, int], ...]
    slope: float
    slope_sd: float

    @property
    def band(self) -> tuple[float, float]:
        """Where the reference lies."""
        return self.mean - 3.0 * self.scatter, self.mean + 3.0 * self.scatter

    @property
    def change(self) -> float:
        """The mean of the last three rows less that of the reference."""
        return float(np.mean(self.y[-3:]) - self.mean)


@dataclass(frozen=True)
class Forecast:
    """At which x the limit is reached, with a 95 % interval; ends may be infinite."""

    x: float
    low: float
    high: float


def trend_of(name: str, x: Array, y: Array) -> Trend | None:
    """Return the trend of a series with x rising; None below `LEAST_ROWS`."""
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    if len(y) < LEAST_ROWS:
        return None
    mean = float(np.mean(y[:REFERENCE]))
    scatter = max(float(np.std(y[:REFERENCE], ddof=1)), LEAST_SCATTER * abs(mean), 1e-12)
    changes = _changes(_deviates((y - mean) / scatter))
    noticed, since = next(((c.noticed, c.since) for c in changes if c.back is None), (None, None))
    part = slice(None) if since is None else slice(max(since - 1, 0), None)
    slope, slope_sd = _line(x[part], y[part])[1:3]
    return Trend(
        name=name,
        x=x,
        y=y,
        mean=mean,
        scatter=scatter,
        noticed=noticed,
        since=since,
        passed=tuple((c.noticed, c.back) for c in changes if c.back is not None),
        slope=slope,
        slope_sd=slope_sd,
    )


def _deviates(z: Array) -> Array:
    from scipy.special import ndtri, stdtr

    # Far out both ends are equally certain; infinity is no number to sum up.
    below = stdtr(REFERENCE - 1, -np.abs(z) / math.sqrt(1.0 + 1.0 / REFERENCE))
    return np.asarray(np.sign(z) * np.minimum(-ndtri(np.maximum(below, 1e-15)), CAP), float)


class _Change(NamedTuple):
    """Rows from which the sum rose, at which it exceeded H, and at which it had fallen to 0."""

    since: int
    noticed: int
    back: int | None = None


def _changes(u: Array) -> list[_Change]:
    """Return the changes in their order; the last one may not have come back."""
    sums, began, changes = [0.0, 0.0], [0, 0], list[_Change]()
    side: int | None = None
    """That of the change that has not come back."""
    for place in range(REFERENCE, len(u)):
        for number, sign in enumerate((1.0, -1.0)):
            if sums[number] == 0.0:
                began[number] = place
            sums[number] = max(0.0, sums[number] + sign * float(u[place]) - SLACK)
        if side is not None and sums[side] == 0.0:
            changes[-1] = changes[-1]._replace(back=place)
            side = None
        for number in (0, 1):
            if side is None and sums[number] > THRESHOLD:
                side = number
                changes.append(_Change(began[number], place))
            sums[number] = min(sums[number], THRESHOLD)
    return changes


def _line(x: Array, y: Array) -> tuple[float, float, float, float, Array]:
    """Intercept, slope, its standard error, residual scatter, and the covariance of both."""
    if len(x) < 3 or np.ptp(x) == 0.0:
        return float(np.mean(y)), 0.0, math.inf, math.inf, np.full((2, 2), math.inf)
    design = np.column_stack([np.ones_like(x), x])
    normal = np.linalg.inv(design.T @ design)
    intercept, slope = normal @ design.T @ y
    residual = y - design @ np.array([intercept, slope])
    scatter = float(np.sqrt(residual @ residual / (len(x) - 2)))
    covariance = scatter**2 * normal
    return (
        float(intercept),
        float(slope),
        float(np.sqrt(covariance[1, 1])),
        scatter,
        np.asarray(covariance, float),
    )


def forecast(trend: Trend, limit: float) -> Forecast | None:
    """Return when the limit is reached; None where the slope does not lead there.

    The interval is Fieller's: all x with (a + b x − L)² ≤ t² var(a + b x). Where the slope is not
    known to differ from zero, no end of it is known, and nothing is forecast.
    """
    from scipy.stats import t as student

    part = slice(None) if trend.since is None else slice(max(trend.since - 1, 0), None)
    x, y = trend.x[part], trend.y[part]
    intercept, slope, slope_sd, _, covariance = _line(x, y)
    if len(x) < 4 or not math.isfinite(slope_sd):
        return None
    quantile = float(student.ppf(0.975, len(x) - 2))
    now = float(trend.x[-1])
    if abs(slope) <= quantile * slope_sd:
        return None
    crossing = (limit - intercept) / slope
    if crossing < now:
        return None
    gap = intercept - limit
    square = quantile**2
    a = slope**2 - square * covariance[1, 1]
    b = 2.0 * (gap * slope - square * covariance[0, 1])
    c = gap**2 - square * covariance[0, 0]
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    low, high = sorted(((-b - root) / (2.0 * a), (-b + root) / (2.0 * a)))
    return Forecast(crossing, max(low, now), high)
