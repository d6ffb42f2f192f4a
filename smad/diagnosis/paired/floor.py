"""The repeat floor: how far recordings of equal inputs on a good bench differ.

Repeats are compared with their mean. Day directions explain a part, whose spread is estimated. The
rest gives a standard deviation for each channel and regime, and a correlation from bin to bin for
each channel. A regime with few rows is shrunk towards the channel's mean over regimes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.numerics.white import RunRows, lag_one_correlation, with_day_form
from smad.diagnosis.plant import Array, Mask

_LEAN_ROWS = 200.0
"""Rows that a channel's mean over regimes counts as, beside those of each regime."""
_ROUNDS = 6
_MOST_RHO = 0.95
_LEAST_SHARE = 0.25
"""Least standard deviation of a regime as a share of its channel's."""
_PSEUDO = 4.0
"""Repeats that the usual spread of days counts as."""
_PRIOR_DEGREES, _FEWEST_DEGREES = 1.0, 2
"""Prior degrees of freedom of a variance, and the fewest of repeats: with one in all, the t
distribution has no variance."""
_GAUGE_ROWS = 50.0
"""White rows of variance 1 that count in a channel beside those of the repeats."""
_MOST_GAUGE = 2.0
"""Largest factor by which repeats raise the floor, before that for few of them; larger differences
show as a gap."""


@dataclass(frozen=True)
class Deviation:
    """A repeat's deviation from the mean of its run, scaled to the spread of a single one.

    `values`, `valid` and `regime` as numbers are (bins, channels), `day` is (directions, bins,
    channels).
    """

    values: Array
    valid: Mask
    regime: Array
    day: Array


@dataclass(frozen=True)
class Floor:
    """Standard deviations (channels, regimes), correlation (channels,), day spread (directions,).

    `degrees` is the number of independent repeats over all runs. `gauge` (channels,) corrects the
    standard deviations: the RMS of the repeats' own white rows, times √(n/(n − 2)) for few repeats,
    n = max(`degrees`, 2) + 1.
    """

    sd: Array
    rho: Array
    day_sd: Array
    degrees: int
    gauge: Array

    def of(self, regime: Array, day: Array) -> Array:
        """Standard deviation of each bin; shape (bins, channels)."""
        return np.asarray(self.gauge * with_day_form(_of_regime(self.sd, regime), day, self.day_sd))


def _of_regime(sd: Array, regime: Array) -> Array:
    """Standard deviations (channels, regimes) by the regime of each bin, (bins, channels)."""
    return np.asarray(sd[np.arange(len(sd)), regime])


def repeat_floor(
    repeats: Sequence[Deviation],
    degrees: int,
    regimes: int,
    *,
    least: Array,
    noise: Array,
    usual_day: Array,
) -> Floor:
    """The floor from repeats, of which `degrees` are independent of the means.

    `least` is a channel's smallest believed sd, `noise` its sd where nothing was repeated.
    `usual_day` is the spread of each day direction before any repeat.
    """
    channels = len(least)
    sd = np.tile(np.maximum(noise, least)[:, None], (1, regimes))
    rho, day_sd = np.full(channels, 0.5), usual_day.copy()
    if degrees == 0:
        return Floor(sd, rho, day_sd, 0, np.ones(channels))
    # A reading that only one repeat of each run has was not repeated.
    repeated = np.any([d.valid.any(axis=0) for d in repeats], axis=0)
    for _ in range(_ROUNDS):
        rests, squares = list[Deviation](), np.zeros_like(day_sd)
        for d in repeats:
            # Correlated rows tell as much as (1 − ρ)/(1 + ρ) of them.
            share = np.sqrt((1.0 - rho) / (1.0 + rho))
            weight = np.where(d.valid, share / _of_regime(sd, d.regime), 0.0)
            coefficient, variance = _day(d.values, weight, d.day, day_sd)
            rest = d.values - np.tensordot(coefficient, d.day, axes=1)
            rests.append(replace(d, values=rest))
            squares += coefficient**2 + variance
        sd = np.where(repeated[:, None], _pooled(rests, regimes, least), sd)
        scaled = (np.where(d.valid, d.values / _of_regime(sd, d.regime), 0.0) for d in rests)
        rho = np.where(repeated, lag_one_correlation(scaled, _MOST_RHO), rho)
        day_sd = np.sqrt((squares + _PSEUDO * usual_day**2) / (len(repeats) + _PSEUDO))
    # Few degrees of freedom: the variance of the t distribution is larger.
    known = max(degrees, _FEWEST_DEGREES) + _PRIOR_DEGREES
    few = np.sqrt(known / (known - 2.0))
    gauge = few * _gauge(repeats, sd, rho, day_sd)
    return Floor(sd, rho, day_sd, degrees, gauge)


def _day(values: Array, weight: Array, day: Array, day_sd: Array) -> tuple[Array, Array]:
    """Coefficients of the day directions in one deviation and their variances, both (days,)."""
    X = day.reshape(len(day), -1) * weight.ravel()
    y = (values * weight).ravel()
    A = X @ X.T + np.diag(1.0 / day_sd**2)
    inverse = np.linalg.inv(A)
    return np.asarray(inverse @ (X @ y)), np.diag(inverse)


def _gauge(repeats: Sequence[Deviation], sd: Array, rho: Array, day_sd: Array) -> Array:
    """Root mean square of the repeats' own white rows, (channels,), at most `_MOST_GAUGE`."""
    total, count = np.full(len(rho), _GAUGE_ROWS), np.full(len(rho), _GAUGE_ROWS)
    for d in repeats:
        sd_with_day = with_day_form(_of_regime(sd, d.regime), d.day, day_sd)
        rows = RunRows(sd_with_day, d.valid, d.day, day_sd, rho)
        white = rows.shrink(rows.independent(d.values[None]))[0].reshape(d.values.shape)
        total = total + (white**2 * d.valid).sum(axis=0)
        count += d.valid.sum(axis=0)
    return np.asarray(np.minimum(np.sqrt(total / count), _MOST_GAUGE))


def _pooled(rests: Sequence[Deviation], regimes: int, least: Array) -> Array:
    channels = len(least)
    total, count = np.zeros((channels, regimes)), np.zeros((channels, regimes))
    for d in rests:
        for c in range(channels):
            good = d.valid[:, c]
            regime, rest = d.regime[good, c], d.values[good, c]
            total[c] += np.bincount(regime, rest**2, minlength=regimes)
            count[c] += np.bincount(regime, minlength=regimes)
    whole = total.sum(axis=1) / np.maximum(count.sum(axis=1), 1.0)
    mean = (total + _LEAN_ROWS * whole[:, None]) / (count + _LEAN_ROWS)
    bottom = np.maximum(least, _LEAST_SHARE * np.sqrt(whole))
    return np.asarray(np.maximum(np.sqrt(mean), bottom[:, None]))
