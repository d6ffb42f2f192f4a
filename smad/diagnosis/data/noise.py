"""The noise floor of each channel: from rest segments, from differences, and from the quantum.

It is estimated from the measurement and from the simulator's residual. Motion that remains in
either adds to the estimate, so the smaller of both counts.
"""

from collections.abc import Sequence

import numpy as np

from smad.diagnosis.data.grid import Grid
from smad.diagnosis.numerics.threads import each
from smad.diagnosis.plant import Array, Mask, PlantModel, nominal_replay, traits_of
from smad.diagnosis.runs import GapRun

_MIN_REST_ROWS = 30
_MIN_REST_RUN = 12
RESOLUTION = 0.001
"""Resolution that no simulator is trusted below, as a share of a channel's excursion."""
_OUTLIER = 4.0
"""Standard deviations beyond which a row at rest is no noise."""
_BANDS = 8
"""Equal parts of a channel's spectrum."""


def _stretches(mask: Mask) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _detrended(y: Array) -> Array:
    t = np.linspace(-1.0, 1.0, len(y))
    return y - np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, y, 2))


def _scale(values: Array) -> float:
    """Standard deviation without outliers: a lost contact or a late edge is not noise.

    The median of |values| serves to find outliers only: as an estimate it is too uncertain.
    """
    middle = float(np.median(np.abs(values))) / 0.6745
    inliers = values[np.abs(values) <= _OUTLIER * middle]
    return float(np.sqrt(np.mean(inliers**2)))


def _sigma(courses: Sequence[Array], valid: Sequence[Mask], rest: Sequence[Mask]) -> float:
    """Noise of one channel: of its rows at rest less a parabola, or of all if it hardly rests.

    `courses` are its rows in each run, measured or unexplained, with masks of those that are
    `valid` and of those at `rest`, (rows,) each.
    """
    at_rest = [
        _detrended(y[s])
        for y, mask in zip(courses, rest, strict=True)
        for s in _stretches(mask)
        if s.stop - s.start >= _MIN_REST_RUN
    ]
    rows = sum(len(y) for y in at_rest)
    if rows < _MIN_REST_ROWS:
        longest = [
            y[max(_stretches(mask), key=lambda s: s.stop - s.start)]
            for y, mask in zip(courses, valid, strict=True)
            if mask.any()
        ]
        return _difference_sigma(longest)
    # Three coefficients were fitted to each stretch.
    freedom = max(rows - 3 * len(at_rest), 1) / rows
    return _scale(np.concatenate(at_rest)) / float(np.sqrt(freedom))


def _difference_sigma(courses: Sequence[Array]) -> float:
    """Noise of one channel without rest: the smaller estimate of differences and spectrum."""
    sigma, (quiet, bins) = third_difference_sd(courses), _quietest_band(courses)
    # Motion within a few rows raises third differences. The quietest band of the spectrum bounds
    # the noise; it counts if it is lower by more than four standard errors.
    return quiet if quiet * np.sqrt(1.0 + 4.0 / np.sqrt(bins)) < sigma else sigma


def _quietest_band(courses: Sequence[Array]) -> tuple[float, float]:
    """Standard deviation of white noise as strong as the quietest band, and the band's bins."""
    powers, bins = np.zeros(_BANDS), np.zeros(_BANDS)
    for y in (y for y in courses if len(y) > 2 * _BANDS):
        window = np.hanning(len(y))
        level = y - np.linspace(y[0], y[-1], len(y))
        power = np.square(np.abs(np.fft.rfft(window * level)[1:])) / np.sum(window**2)
        for i, band in enumerate(np.array_split(power, _BANDS)):
            powers[i] += float(np.sum(band))
            bins[i] += len(band)
    if not bins.any():
        return float("inf"), 1.0
    means = powers / bins
    least = int(np.argmin(means))
    return float(np.sqrt(means[least])), float(bins[least])


def third_difference_sd(courses: Sequence[Array]) -> float:
    """Standard deviation of the white noise in evenly sampled courses, (n,) each; 0 of none.

    Third differences remove any smooth course; their variance is 20 σ². The lower quartile of their
    sizes keeps the edges of the excitation out. NaN does not count.
    """
    sizes = np.abs(np.concatenate([np.zeros(0), *(np.diff(y, 3) for y in courses)]))
    sizes = sizes[np.isfinite(sizes)]
    return float(np.quantile(sizes, 0.25) / 0.3186 / np.sqrt(20.0)) if len(sizes) else 0.0


def estimate_floors(runs: Sequence[GapRun], plant: PlantModel, period_s: float) -> Array:
    """Floors of channels in their units, (channels,): noise and resolution in quadrature."""
    return np.asarray(np.hypot(row_noise(runs, plant, period_s), resolution(runs, plant)))


def resolution(runs: Sequence[GapRun], plant: PlantModel) -> Array:
    """The error that any simulator is allowed, by channel, in its unit, (channels,)."""
    columns = (
        [r.outputs[c.name][r.good] for r in runs if c.name in r.outputs] for c in plant.channels
    )
    return np.array([RESOLUTION * excursion(c) for c in columns])


def row_noise(runs: Sequence[GapRun], plant: PlantModel, period_s: float) -> Array:
    """The noise of a row of `period_s` of each channel, in its unit; (channels,).

    It is at least that of the quantum. A channel that no run has keeps its typical noise. Where all
    of these are 0, as in a still channel of a model, a share of its range stands for them.
    """
    exact = each(
        lambda run: nominal_replay(run, plant, fast=False), runs, traits_of(plant).together
    )
    grids = [Grid.of(run, period_s) for run in runs]
    noise = np.array([max(c.noise, c.quantum) for c in plant.channels])
    for i, channel in enumerate(plant.channels):
        courses = []
        for run, grid, simulated in zip(runs, grids, exact, strict=True):
            if (y := run.outputs.get(channel.name)) is not None:
                rows, left = grid.mean(y), y - simulated[channel.name]
                simulates = np.isfinite(left[run.good]).all()
                rest = grid.majority(plant.regimes(run, channel.side)["rest"]) & grid.valid
                courses.append((rows, grid.mean(left) if simulates else rows, grid.valid, rest))
        if courses:
            measured, unexplained, *masks = zip(*courses, strict=True)
            least = float(channel.quantum / np.sqrt(12.0))
            sigma = min(_sigma(rows, *masks) for rows in (measured, unexplained))
            noise[i] = max(sigma, least) or channel.noise
    ranges = np.array([c.high - c.low for c in plant.channels])
    return np.where(noise > 0.0, noise, RESOLUTION * ranges)


def excursion(columns: Sequence[Array]) -> float:
    """Median over a channel's columns, (n,) each, of the range between its extreme percents."""
    ranges = [np.ptp(np.quantile(y, (0.01, 0.99))) for y in columns]
    return float(np.median(ranges)) if ranges else 0.0
