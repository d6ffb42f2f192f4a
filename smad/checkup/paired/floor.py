"""The repeat floor: how much equal inputs on a good bench differ from one time to another.

Repeats are compared with their mean. What a few day directions explain is counted as their spread;
of the rest a standard deviation is taken for each output and regime, and a correlation from bin to
bin for each output. A regime with few rows leans on its output's other regimes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.white import RunRows, with_day_form
from smad.diagnosis.plant import Array, Mask

_LEAN_ROWS = 200.0
_ROUNDS = 6
_MOST_RHO = 0.95
_LEAST_SHARE = 0.25
_PSEUDO = 4.0
_T = 1.0
_GAUGE_ROWS = 50.0
_GAUGES = (0.9, 2.0)


@dataclass(frozen=True)
class Deviations:
    """One run's repeats: deviations from their mean, scaled to the spread of a single one.

    `values` (repeats, bins, channels), `valid` likewise, `regime` (bins, channels) as numbers,
    `day` (directions, bins, channels). `free` is how many of the repeats are independent of the
    mean: one less than there are.
    """

    values: Array
    valid: Mask
    regime: Array
    day: Array

    @property
    def free(self) -> int:
        return max(len(self.values) - 1, 0)


@dataclass(frozen=True)
class Floor:
    """Standard deviations (channels, regimes), correlation (channels,), day spread (directions,).

    `degrees` is how many independent repeats it rests on, over all runs. `gauge` (channels,) is
    what white rows of the repeats themselves showed, by which standard deviations are corrected.
    """

    sd: Array
    rho: Array
    day_sd: Array
    degrees: int
    gauge: Array

    def of(self, regime: Array, day: Array) -> Array:
        """Standard deviation of each bin; shape (bins, channels)."""
        channels = np.arange(regime.shape[1])
        own = self.sd[channels[None, :], regime]
        return np.asarray(self.gauge * with_day_form(own, day, self.day_sd))


def repeat_floor(
    groups: Sequence[Deviations], regimes: int, least: Array, usual_day: Array
) -> Floor:
    """The floor from repeats; `least` is a channel's smallest believed sd, and its usual one where
    nothing was repeated. `usual_day` is the spread of each day direction before any repeat."""
    channels = len(least)
    degrees = sum(g.free for g in groups)
    sd = np.tile(4.0 * least[:, None], (1, regimes))
    rho, day_sd = np.full(channels, 0.5), usual_day.copy()
    if degrees == 0:
        return Floor(sd, rho, day_sd, 0, np.ones(channels))
    for _ in range(_ROUNDS):
        left, squares, number = [], np.zeros_like(day_sd), 0.0
        for g in groups:
            if not g.free:
                continue
            scale = sd[np.arange(channels)[None, :], g.regime]
            for values, valid in zip(g.values, g.valid, strict=True):
                # Correlated rows tell as much as (1 − ρ)/(1 + ρ) of them.
                share = np.sqrt((1.0 - rho) / (1.0 + rho))
                weight = np.where(valid, share / scale, 0.0)
                coefficient, variance = _day(values, weight, g.day, day_sd)
                rest = values - np.tensordot(coefficient, g.day, axes=1)
                left.append((rest, valid, g.regime))
                squares += coefficient**2 + variance
                number += 1.0
        sd = _pooled(left, regimes, least)
        rho = _correlation(left, sd)
        day_sd = np.sqrt((squares + _PSEUDO * usual_day**2) / (number + _PSEUDO))
    # A variance of few degrees of freedom is often too small: that of a t distribution.
    few = np.sqrt((degrees + _T) / max(degrees + _T - 2.0, 1.0))
    gauge = few * _gauge(groups, sd, rho, day_sd)
    return Floor(sd, rho, day_sd, degrees, gauge)


def _day(values: Array, weight: Array, day: Array, day_sd: Array) -> tuple[Array, Array]:
    """Coefficients of the day directions in one deviation and their variances, both (days,)."""
    X = day.reshape(len(day), -1) * weight.ravel()
    y = (values * weight).ravel()
    A = X @ X.T + np.diag(1.0 / day_sd**2)
    inverse = np.linalg.inv(A)
    return np.asarray(inverse @ (X @ y)), np.diag(inverse)


def _gauge(groups: Sequence[Deviations], sd: Array, rho: Array, day_sd: Array) -> Array:
    """Root mean square of the repeats' own white rows, (channels,), within `_GAUGES`."""
    channels = len(rho)
    total, count = np.full(channels, _GAUGE_ROWS), np.full(channels, _GAUGE_ROWS)
    for g in groups:
        if not g.free:
            continue
        scale = sd[np.arange(channels)[None, :], g.regime]
        for values, valid in zip(g.values, g.valid, strict=True):
            own = with_day_form(scale, g.day, day_sd)
            rows = RunRows(own, valid, g.day, day_sd, rho)
            white = rows.shrink(rows.independent(values[None]))[0].reshape(values.shape)
            total = total + (white**2 * valid).sum(axis=0)
            count += valid.sum(axis=0)
    return np.asarray(np.clip(np.sqrt(total / count), *_GAUGES))


def _pooled(left: Sequence[tuple[Array, Mask, Array]], regimes: int, least: Array) -> Array:
    channels = len(least)
    total, count = np.zeros((channels, regimes)), np.zeros((channels, regimes))
    for rest, valid, regime in left:
        for c in range(channels):
            good = valid[:, c]
            total[c] += np.bincount(regime[good, c], rest[good, c] ** 2, minlength=regimes)
            count[c] += np.bincount(regime[good, c], minlength=regimes)
    whole = total.sum(axis=1) / np.maximum(count.sum(axis=1), 1.0)
    mean = (total + _LEAN_ROWS * whole[:, None]) / (count + _LEAN_ROWS)
    bottom = np.maximum(least, _LEAST_SHARE * np.sqrt(whole))
    return np.asarray(np.maximum(np.sqrt(mean), bottom[:, None]))


def _correlation(left: Sequence[tuple[Array, Mask, Array]], sd: Array) -> Array:
    channels = len(sd)
    product, square = np.zeros(channels), np.full(channels, 1e-12)
    for rest, valid, regime in left:
        e = np.where(valid, rest / sd[np.arange(channels)[None, :], regime], 0.0)
        product += (e[1:] * e[:-1]).sum(axis=0)
        square += (e**2).sum(axis=0)
    return np.asarray(np.clip(product / square, 0.0, _MOST_RHO))
