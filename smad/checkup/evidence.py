"""How much speaks for each hypothesis of a check-up, where no law has just the bench's form.

White rows have variance 1 on a bench without a change. Beside an entry that takes G of their sum of
squares, what its law gets wrong adds to that, so every hypothesis is judged with the variance
v = 1 + `form_share`² G in each row. Parameters are tied to where they were under an entry
and within `free_share` of their prior's standard deviation under *parameters*; the determinant of
that is what the freedom costs. All of it follows from inner products, so that other constants can
be tried without another replay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.checkup.constants import Constants
from smad.checkup.paired.difference import SHARE, Paired
from smad.diagnosis.plant import Array
from smad.diagnosis.search.names import PER_COORDINATE
from smad.diagnosis.search.refine import Refined

_PRIOR = 1.0
_LEAST_DIRECTION = 1e-9
_RIDGE = 1e-6


@dataclass(frozen=True)
class Products:
    """Inner products of white rows, parameters tied.

    `rows` (1 + h, 1 + h) are those of the difference and of what each of h hypotheses changes, the
    `singles` first. `along` (directions, 1 + h) are their components along the directions in which
    parameters move the rows, `squares` (directions,) the squared lengths of these for one standard
    deviation of the priors. `coordinates` (h,) counts what is free in each hypothesis. `beyond` is
    what stands out of channels when all singles and all parameters are free.
    """

    rows: Array
    along: Array
    squares: Array
    coordinates: Array
    singles: int
    beyond: float

    def under(self, variance: float, share: float) -> Array:
        """The products with rows of this variance and parameters within a share of their priors."""
        across = self.rows - self.along.T @ self.along
        untied = self.along * np.sqrt(1.0 + SHARE**2 * self.squares)[:, None]
        spread = variance + share**2 * self.squares
        return np.asarray(across / variance + (untied / spread[:, None]).T @ untied)

    def variance(self, constants: Constants) -> float:
        """Variance of a row beside an entry, by the best of the single ones."""
        gains = 2.0 * self.rows[0, 1:] - np.diag(self.rows)[1:]
        return variance(float(gains[: self.singles].max(initial=0.0)), constants)


def variance(gain: float, constants: Constants) -> float:
    """Variance of a row where the best entry takes `gain` of the sum of squares."""
    return 1.0 + constants.form_share**2 * max(gain, 0.0)


@dataclass(frozen=True)
class Evidence:
    """Log evidence against *nothing*, nats.

    `sets` (h,) are those of the hypotheses of `Products`, `parameters` that of other values of
    parameters. `gains` (h + 1,) are the same without what freedom costs, parameters last, and
    `flexible` what a correction gains that has all singles, all parameters and every channel free.
    """

    sets: Array
    parameters: float
    gains: Array
    flexible: float

    def left_by(self, index: int) -> float:
        """Share of what the flexible correction gains that a hypothesis leaves, −1: parameters."""
        taken = float(self.gains[index])
        return float(np.clip(1.0 - taken / max(self.flexible, 1e-9), 0.0, 1.0))


def evidence(p: Products, constants: Constants) -> Evidence:
    """The evidence of every hypothesis under these constants."""
    v = p.variance(constants)
    tied = p.under(v, SHARE)
    gains = tied[0, 1:] - 0.5 * np.diag(tied)[1:]
    free = _free(p, tied, v, constants.free_share)
    cost = 0.5 * float(
        np.log1p(constants.free_share**2 * p.squares / v).sum()
        - np.log1p(SHARE**2 * p.squares / v).sum()
    )
    prior = p.under(v, _PRIOR)
    own = slice(1, 1 + p.singles)
    G, b = prior[own, own], prior[own, 0]
    ridge = _RIDGE * np.diag(np.maximum(np.diag(G), 1.0 / v))
    entries = 0.5 * float(b @ np.linalg.solve(G + ridge, b))
    flexible = _free(p, tied, v, _PRIOR) + entries + 0.5 * p.beyond / v
    return Evidence(
        gains - 0.5 * PER_COORDINATE * p.coordinates / v,
        free - cost,
        np.append(gains, free),
        flexible,
    )


def _free(p: Products, tied: Array, v: float, share: float) -> float:
    """What parameters within a share of their priors gain beyond the tied ones."""
    return float(0.5 * (tied[0, 0] - p.under(v, share)[0, 0]))


def products(
    paired: Paired, singles: Sequence[Refined], steps: Sequence[Refined], constants: Constants
) -> Products:
    """The inner products of a check-up's hypotheses, of which `singles` come first."""
    z, J = paired.z, paired.slopes
    changes = np.array([f.change for f in (*singles, *steps)]).reshape(-1, len(z))
    rows = np.concatenate([z[None], changes])
    squares, inner = np.linalg.eigh(J @ J.T)
    kept = squares > _LEAST_DIRECTION * max(float(squares.max(initial=0.0)), 1.0)
    basis = (inner[:, kept].T @ J) / np.sqrt(squares[kept])[:, None]
    free = np.concatenate([changes[: len(singles)], paired.tie(J)])
    return Products(
        rows @ rows.T,
        basis @ rows.T,
        squares[kept],
        np.array([len(f.coordinates) for f in (*singles, *steps)], float),
        len(singles),
        _beyond(paired, free, len(singles), constants.channel_ratio),
    )


def _beyond(paired: Paired, free: Array, entries: int, ratio: float) -> float:
    """What channels show beyond a quiet one's, once everything is free within its prior."""
    z, white = paired.z, paired.white
    A = free @ free.T
    ridge = np.ones(len(free))
    ridge[:entries] = _RIDGE * np.maximum(np.diag(A)[:entries], 1.0)
    left = z - np.linalg.solve(A + np.diag(ridge), free @ z) @ free
    good, channel = white.valid, white.channel_of_row()
    quiet = ratio * np.bincount(channel[good])
    return float(np.maximum(np.bincount(channel[good], left[good] ** 2) - quiet, 0.0).sum())
