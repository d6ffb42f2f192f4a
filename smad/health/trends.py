"""What changed in a series, since when, and when it will reach a limit. Pure.

Change: a two-sided cumulative sum (E. S. Page, Biometrika 41, 1954)

    S⁺_k = max(0, S⁺_{k−1} + u_k − K),   S⁻_k = max(0, S⁻_{k−1} − u_k − K),

noticed when either exceeds H. It stays there until it falls to 0: the series has come back.
|u_k| ≤ C, since an odd row is no change (J. M. Lucas, R. B. Crosier, Comm. Statist. 11, 1982).

With mean m and scatter s of the first n rows (y_k − m) / (s √(1+1/n)) has Student's t distribution
with n − 1 degrees of freedom while nothing changes; u_k is the normal deviate of the same
probability, so that a scatter known from few rows gives no false alarms.

Rows of one sitting differ less than sittings do, as samples of a subgroup do in a control chart
(S. J. Janis, Is your process too good for its control limits?, ASQC 1990). So a row is judged by
those of its sitting, and a sitting's median by those of sittings before it: from the third on, as
nothing is known of two (self-starting: D. M. Hawkins, The Statistician 36, 1987). A change within a
sitting stands while the medians of all later ones are beyond its band, too.

Forecast: the line y = a + b x by least squares since the change; it crosses the limit L at
x = (L − a) / b, with Fieller's interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from smad.arrays import Array

REFERENCE = 10
"""The first so many rows are the bench as it was."""
LEAST_ROWS = REFERENCE + 2
SITTING_GAP_S = 6 * 3600.0
"""After such a pause water, room and zeros of sensors may be others: another sitting."""
LEAST_SITTINGS = 4
_KNOWN_SITTINGS = 2
"""The first that is judged is the next."""
SLACK = 1.25
"""K: the mean of ten rows is itself uncertain by a third of s."""
THRESHOLD = 7.0
"""H. With K and C: of series of 41 rows in which nothing changes 1 in 1000 changes."""
CAP = 3.25
"""C: with K and H, three rows far out are no change and four are."""
LEAST_SCATTER = 1e-3
"""s is at least this share of the mean: readings have digits."""


@dataclass(frozen=True, kw_only=True)
class Trend:
    """One series. `noticed` is the place of the row at which a change was noticed, None: none.

    `passed` are the rows at which earlier changes were noticed, and at which each had come back.
    `since` is the row from which the cumulative sum rose: about where the change began. `band` is
    mean ± 3 scatters of the reference.
    """

    name: str
    x: Array
    y: Array
    mean: float
    scatter: float
    noticed: int | None
    since: int | None
    passed: tuple[tuple[int, int], ...]

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


def trend_of(name: str, x: Array, y: Array, unix_s: Array) -> Trend | None:
    """Return the trend of a series with x and time rising; None with too few rows and sittings."""
    finite = np.isfinite(x) & np.isfinite(y)
    x, y, unix_s = x[finite], y[finite], unix_s[finite]
    sittings = _sittings(unix_s)
    charts = [_within(y, sittings, number) for number in range(len(sittings))]
    chart = _between(y, sittings) if len(sittings) >= LEAST_SITTINGS else None
    usable = [c for c in (chart, *charts) if c is not None]
    if not usable:
        return None
    mean, scatter, _ = usable[0]
    changes = sorted(change for c in usable for change in c.changes)
    first = min((c for c in changes if c.back is None), key=lambda c: c.noticed, default=None)
    return Trend(
        name=name,
        x=x,
        y=y,
        mean=mean,
        scatter=scatter,
        noticed=None if first is None else first.noticed,
        since=None if first is None else first.since,
        passed=tuple((c.noticed, c.back) for c in changes if c.back is not None),
    )


class _Change(NamedTuple):
    """Rows from which the sum rose, at which it exceeded H, and at which it had fallen to 0."""

    since: int
    noticed: int
    back: int | None = None
    sign: int = 1


class _Chart(NamedTuple):
    """Mean and scatter of the reference, and the changes in their order, as places of rows."""

    mean: float
    scatter: float
    changes: tuple[_Change, ...]


def _sittings(unix_s: Array) -> list[slice]:
    begins = [0, *(np.flatnonzero(np.diff(unix_s) > SITTING_GAP_S) + 1).tolist(), len(unix_s)]
    return [slice(begin, end) for begin, end in pairwise(begins) if end > begin]


def _within(y: Array, sittings: Sequence[slice], number: int) -> _Chart | None:
    """Return the chart of the rows of one sitting, whose last change later sittings may end."""
    sitting = sittings[number]
    rows = y[sitting]
    if len(rows) < LEAST_ROWS:
        return None
    mean, scatter = _reference(rows[:REFERENCE])
    places = range(sitting.start, sitting.stop)
    changes = _placed(_changes(_deviates(rows, REFERENCE)), places, places)
    if changes and changes[-1].back is None:
        for later in sittings[number + 1 :]:
            if changes[-1].sign * (float(np.median(y[later])) - mean) <= 3.0 * scatter:
                changes[-1] = changes[-1]._replace(back=later.stop - 1)
                break
    return _Chart(mean, scatter, tuple(changes))


def _between(y: Array, sittings: Sequence[slice]) -> _Chart:
    """Return the chart of the sittings' medians."""
    medians = np.array([np.median(y[sitting]) for sitting in sittings])
    changes = _changes(_deviates(medians, _KNOWN_SITTINGS))
    first_rows, last_rows = zip(*((s.start, s.stop - 1) for s in sittings), strict=True)
    return _Chart(*_reference(medians[:REFERENCE]), tuple(_placed(changes, first_rows, last_rows)))


def _placed(changes: list[_Change], first: Sequence[int], last: Sequence[int]) -> list[_Change]:
    """Return changes of a chart's points as those of rows: a point's first and last."""
    return [
        change._replace(
            since=first[change.since],
            noticed=last[change.noticed],
            back=None if change.back is None else last[change.back],
        )
        for change in changes
    ]


def _reference(y: Array) -> tuple[float, float]:
    """Return mean and scatter."""
    mean = float(np.mean(y))
    return mean, max(float(np.std(y, ddof=1)), LEAST_SCATTER * abs(mean), 1e-12)


def _deviates(y: Array, first: int) -> Array:
    """Return u of each value by those before it, ten at most; 0 for the `first` ones."""
    from scipy.special import ndtri, stdtr

    u = np.zeros(len(y))
    for place in range(first, len(y)):
        n = min(place, REFERENCE)
        mean, scatter = _reference(y[:n])
        t = (y[place] - mean) / (scatter * math.sqrt(1.0 + 1.0 / n))
        # Far out both ends are equally certain; infinity is no number to sum up.
        below = max(float(stdtr(n - 1, -abs(t))), 1e-15)
        u[place] = math.copysign(min(-float(ndtri(below)), CAP), t)
    return u


def _changes(u: Array) -> list[_Change]:
    """Return the changes in their order; the last one may not have come back."""
    sums, began, changes = {1: 0.0, -1: 0.0}, {1: 0, -1: 0}, list[_Change]()
    for place, deviate in enumerate(u):
        for sign in (1, -1):
            if sums[sign] == 0.0:
                began[sign] = place
            sums[sign] = max(0.0, sums[sign] + sign * float(deviate) - SLACK)
        if changes and changes[-1].back is None and sums[changes[-1].sign] == 0.0:
            changes[-1] = changes[-1]._replace(back=place)
        for sign in (1, -1):
            if sums[sign] > THRESHOLD and (not changes or changes[-1].back is not None):
                changes.append(_Change(began[sign], place, sign=sign))
            sums[sign] = min(sums[sign], THRESHOLD)
    return changes


def forecast(trend: Trend, limit: float) -> Forecast | None:
    """Return when the limit is reached; None where the slope does not lead there.

    The interval is Fieller's: all x with (a + b x − L)² ≤ t² var(a + b x). Where the slope is not
    known to differ from zero, no end of it is known, and nothing is forecast.
    """
    from scipy.stats import t as student

    part = slice(None) if trend.since is None else slice(max(trend.since - 1, 0), None)
    x, y = trend.x[part], trend.y[part]
    if len(x) < 4 or np.ptp(x) == 0.0:
        return None
    line, covariance = np.polyfit(x, y, 1, cov=True)
    slope, intercept = line.tolist()
    (slope_var, both_var), (_, intercept_var) = covariance.tolist()
    quantile = float(student.ppf(0.975, len(x) - 2))
    now = float(trend.x[-1])
    if abs(slope) <= quantile * math.sqrt(slope_var):
        return None
    crossing = (limit - intercept) / slope
    if crossing < now:
        return None
    gap = intercept - limit
    square = quantile**2
    a = slope**2 - square * slope_var
    b = 2.0 * (gap * slope - square * both_var)
    c = gap**2 - square * intercept_var
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    low, high = sorted(((-b - root) / (2.0 * a), (-b + root) / (2.0 * a)))
    return Forecast(crossing, max(low, now), high)
