"""Fewer points than were measured: the extremes of each stretch, in their order."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from smad.arrays import Array

LONG_PAUSE = 10.0
"""Times the usual step between two samples: from there on the line is broken."""


def stride(count: int, most: int) -> int:
    """Return n where every n-th of `count` samples stays, so that at most `most` do."""
    return max(1, -(-count // most))


def in_order(low: Array, high: Array, first: Array, last: Array) -> Array:
    """Return both extremes of n stretches, shape (2n,): the lower first where the signal rises."""
    rising = ~(last < first)
    return _alternating(np.where(rising, low, high), np.where(rising, high, low))


def pauses(x: Array, long_pause: float = LONG_PAUSE) -> NDArray[np.int64]:
    """Return where `x` of shape (n,) goes on after a step of `long_pause` times the usual one."""
    steps = np.diff(x)
    usual = float(np.median(steps)) if steps.size else 0.0
    return np.flatnonzero(steps > (long_pause * usual if usual > 0.0 else np.inf)) + 1


class Decimation:
    """How an axis `x` of n samples is thinned: two points a stretch, and a break at each pause.

    `x` is then what is left; where n is at most `most` all stay. A pause is a step of `long_pause`
    times the usual one.
    """

    def __init__(self, x: Array, most: int, long_pause: float = LONG_PAUSE) -> None:
        paused = pauses(x, long_pause)
        self._whole = x.size <= most
        if self._whole:
            self._starts = np.arange(x.size)
            self._breaks = paused
            points = x
        else:
            step = stride(2 * x.size, most)
            pieces = pairwise([0, *paused.tolist(), x.size])
            starts = [np.arange(begin, end, step) for begin, end in pieces]
            self._starts = np.concatenate(starts)
            self._breaks = 2 * np.cumsum([piece.size for piece in starts])[:-1]
            ends = np.append(self._starts[1:], x.size)
            points = _alternating(x[self._starts], x[(self._starts + ends) // 2])
        self._ends = np.append(self._starts[1:], x.size) - 1
        middles = (points[self._breaks - 1] + points[self._breaks]) / 2.0
        self.x = np.insert(points, self._breaks, middles)

    def thinned(self, y: Array) -> Array:
        """`y` of shape (n,) at the points of `x`: the extremes of each stretch; NaN at a break."""
        if not self._whole:
            low, high = np.fmin.reduceat(y, self._starts), np.fmax.reduceat(y, self._starts)
            y = in_order(low, high, y[self._starts], y[self._ends])
        return np.insert(y, self._breaks, np.nan)


def _alternating(first: Array, second: Array) -> Array:
    return np.stack([first, second], axis=1).ravel()
