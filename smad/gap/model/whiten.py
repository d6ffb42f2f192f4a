"""Σ = σ²I + K_δ(regime): what a residual weighs, and the filter that makes it white.

Each output has a floor σ, a discrepancy k by regime, and a correlation time. The residual divided
by s = sqrt(σ² + k²) is a mixture of white noise and an Ornstein–Uhlenbeck process; sampled on the
grid that is an ARMA(1,1) process, whose innovations filter is exact after the first samples.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from smad.gap.data.replay import Dataset
from smad.gap.plant import Array


@dataclass(frozen=True)
class OutputNoise:
    """Noise and discrepancy of one output.

    `sigma` is the floor of one row, in channel units. `k` is the discrepancy by regime, with the
    entry "" for rows in no regime. `tau_s` is the correlation time of the discrepancy, and
    `noise_rho` the correlation of the sensor noise between neighbouring rows.
    """

    sigma: float
    k: Mapping[str, float] = field(default_factory=dict)
    tau_s: float = 0.0
    noise_rho: float = 0.0


def arma_innovations(share: float, rho: float) -> tuple[float, float]:
    """(θ, v) of (1 − ρB) z = (1 − θB) e, var e = v, for z of unit variance.

    z is white noise of variance 1 − `share` plus an AR(1) process of variance `share` and
    coefficient `rho`. Invertible root: |θ| < 1.
    """
    gamma0 = share * (1 - rho**2) + (1 - share) * (1 + rho**2)
    gamma1 = -rho * (1 - share)
    if abs(gamma1) < 1e-12:
        return 0.0, gamma0
    half = -gamma0 / (2 * gamma1)
    theta = half - np.sign(half) * np.sqrt(half**2 - 1)
    return float(theta), float(-gamma1 / theta)


def lagged_products(series: Sequence[Array], longest: int) -> Array:
    """Σ y_t y_{t+k} of all series together at lags k = 0 … `longest`; shape (longest + 1,)."""
    total = np.zeros(longest + 1)
    for y in series:
        spectrum = np.fft.rfft(y, 2 * len(y))
        own = np.fft.irfft(np.abs(spectrum) ** 2)[: min(longest + 1, len(y))]
        total[: len(own)] += own
    return total


class Whitening:
    """Turns rows of `dataset` into scaled rows (`scale`) and white rows (`white`)."""

    def __init__(self, dataset: Dataset, noise: Mapping[str, OutputNoise]) -> None:
        self.dataset, self.noise = dataset, noise
        self.s = np.ones(dataset.n)
        self._filters: list[tuple[float, float, float]] = []
        masks = dataset.regime_masks
        for seg in dataset.segments:
            model = noise[seg.key]
            k = np.full(seg.stop - seg.start, model.k.get("", 0.0))
            free = np.ones_like(k, dtype=bool)
            # The first regime that holds, in the plant's order, is the one that counts.
            for name, mask in masks.items():
                here = mask[seg.rows] & free
                k[here] = model.k.get(name, model.k.get("", 0.0))
                free &= ~here
            self.s[seg.rows] = np.sqrt(model.sigma**2 + k**2)
            self._filters.append(self._filter_of(model, float(np.mean(k**2))))
        self._weigh()

    def _weigh(self) -> None:
        self._factor = np.where(self.dataset.valid, 1.0 / self.s, 0.0)

    def _filter_of(self, model: OutputNoise, k2: float) -> tuple[float, float, float]:
        share = k2 / (k2 + model.sigma**2)
        if share > 0.05 and model.tau_s > 0:
            rho = float(np.exp(-self.dataset.settings.period_s / model.tau_s))
            return rho, *arma_innovations(min(share, 0.99), rho)
        if model.noise_rho > 0.05:
            return model.noise_rho, *arma_innovations(1.0, model.noise_rho)
        return 0.0, 0.0, 1.0

    def beside(self, unsure: Array) -> Whitening:
        """The same with another uncertainty of each row, in channel units, in quadrature."""
        other = copy.copy(self)
        other.s = np.hypot(self.s, unsure)
        other._weigh()
        return other

    def scale(self, rows: Array) -> Array:
        """Rows over their standard deviation; invalid rows become 0."""
        return rows * (self._factor if rows.ndim == 1 else self._factor[:, None])

    def white(self, rows: Array) -> Array:
        """Innovations of the scaled rows; unit variance where Σ is right. Shape as given."""
        z = self.scale(rows)
        for seg, (rho, theta, v) in zip(self.dataset.segments, self._filters, strict=True):
            if rho == 0.0:
                continue
            part, root = z[seg.rows], np.sqrt(v)
            first = (root - 1.0) * part[:1]
            z[seg.rows] = lfilter([1.0, -rho], [1.0, -theta], part, axis=0, zi=first)[0] / root
        z[~self.dataset.valid] = 0.0
        return z
