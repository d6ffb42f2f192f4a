"""White rows: on a bench without a change they are independent, with variance 1.

A difference is divided by the floor of its channel and regime, whitened by AR(1) with a factor for
each channel, and shrunk along the directions in which days differ. Missing rows are 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.diagnosis.plant import Array, Mask

_LEAST_DIRECTION = 1e-6
_DAY_FORM = 0.4


def shrinking(directions: Array) -> Callable[[Array], Array]:
    """A function that applies (I + DᵀD)^(−1/2) to rows (m, n), for directions D given as (k, n)."""
    # Through the small matrix of inner products: there are few directions and many rows.
    square, inner = np.linalg.eigh(directions @ directions.T)
    keep = square > _LEAST_DIRECTION
    basis = (inner[:, keep].T @ directions) / np.sqrt(square[keep])[:, None]
    factor = 1.0 - 1.0 / np.sqrt(1.0 + square[keep])
    return lambda values: np.asarray(values - ((values @ basis.T) * factor) @ basis)


def with_day_form(sd: Array, day: Array, day_sd: Array) -> Array:
    """Standard deviations with the form error of the day directions, a share of them, added.

    The model's slope of, say, the film is not the bench's, so large day effects cannot be removed
    exactly.
    """
    moved = np.tensordot(day_sd**2, day**2, axes=1)
    return np.asarray(np.sqrt(sd**2 + _DAY_FORM**2 * moved))


def lag_one_correlation(rows: Iterable[Array], most: float) -> Array:
    """Correlation ρ of each bin with the next in all runs, from 0 to `most`, (channels,).

    `rows` are (bins, channels) a run, 0 where nothing counts.
    """
    product, square = 0.0, 1e-12
    for e in rows:
        product = product + (e[1:] * e[:-1]).sum(axis=0)
        square = square + (e**2).sum(axis=0)
    return np.asarray(np.clip(product / square, 0.0, most))


@dataclass(frozen=True)
class RunRows:
    """What whitening needs of one run.

    `sd` (bins, channels) of one difference, `valid` likewise, `day` (directions, bins, channels)
    with their coefficients' standard deviations in `day_sd`; `rho` is one number a channel.
    """

    sd: Array
    valid: Mask
    day: Array
    day_sd: Array
    rho: Array

    @classmethod
    def of(
        cls, sd: Array, valid: Mask, day: Array | None = None, rho: Array | None = None
    ) -> RunRows:
        """Rows of one `sd` for each channel, (channels,); directions are at one deviation."""
        days = np.zeros((0, *valid.shape)) if day is None else day
        return cls(
            sd=np.broadcast_to(sd, valid.shape),
            valid=valid,
            day=days,
            day_sd=np.ones(len(days)),
            rho=np.zeros(len(sd)) if rho is None else rho,
        )

    def with_days(self, directions: Array) -> RunRows:
        """The same with further directions (k, bins, channels) at one standard deviation."""
        return replace(
            self,
            day=np.concatenate([self.day, directions]),
            day_sd=np.concatenate([self.day_sd, np.ones(len(directions))]),
        )

    def independent(self, values: Array) -> Array:
        """Values (m, bins, channels) scaled and whitened by AR(1), as rows (m, rows).

        The first bin of a valid stretch is scaled only.
        """
        scaled = np.where(self.valid, values / self.sd, 0.0)
        out = scaled.copy()
        step = (scaled[:, 1:] - self.rho * scaled[:, :-1]) / np.sqrt(1.0 - self.rho**2)
        out[:, 1:] = np.where(self.valid[1:] & self.valid[:-1], step, scaled[:, 1:])
        return out.reshape(len(values), self.sd.size)

    @cached_property
    def days(self) -> Array:
        """The day directions at one standard deviation, as white rows."""
        return np.asarray(self.independent(self.day) * self.day_sd[:, None])

    @cached_property
    def shrink(self) -> Callable[[Array], Array]:
        """Shrinks rows along the day directions."""
        return shrinking(self.days)
