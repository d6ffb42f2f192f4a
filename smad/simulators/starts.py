"""Where a replay begins: values and rates of the readings at a sample, by a local polynomial.

Of polynomials over some samples around it, the one is taken whose rate the noise disturbs least
among those that the samples do not contradict: a straight line over many where nothing moves, a
cubic over few where much does. A run may also begin at rest, with an input that jumps in its first
row: then polynomials without a rate hold for longer than those with one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from smad.diagnosis.data.noise import third_difference_sd
from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.simulators.columns import correlation_time_s, quantum_of

_OF_CORRELATION = 0.3
_FEWEST, _MOST = 4, 20
"""Samples to either side, at least and at most."""
_SIZES = (1.0, 0.7, 0.5, 0.35, 0.2)
"""Of the most samples, that are tried."""
_MOVING = ((0, 1), (0, 1, 2), (0, 1, 2, 3))
_AT_REST = ((0, 2), (0, 2, 3), (0, 2, 3, 4))
"""Powers of polynomials."""
_RESOLUTION = 1e-5
"""Of what a reading goes through, that no start need be known to."""
_SURE = 3.0
"""Standard deviations of the sum of squares, from which samples contradict a polynomial."""
_OFF = 10.0
"""Times what noise does to a start, that it may be off by: nothing moves as a polynomial does."""
_MOST_FREE = 400
"""Readings and rates that windows of a run begin from, beyond which they are taken as they are: a
diagnosis has a direction for each."""


@dataclass(frozen=True, kw_only=True)
class _Polynomial:
    """A polynomial by least squares: value and rate at time 0, and how uncertain both are, in
    standard deviations of a sample. `squares` of what it leaves of `samples` have `free` degrees of
    freedom."""

    value: float
    rate: float
    value_error: float
    rate_error: float
    squares: float
    samples: int
    free: int

    def contradicted(self, variance: float) -> bool:
        """Whether it leaves more than noise would."""
        most = self.free + _SURE * np.sqrt(2.0 * self.free)
        return bool(self.squares > most * variance)


def _fit(t: Array, y: Array, powers: tuple[int, ...]) -> _Polynomial:
    scale = float(np.abs(t).max())
    columns = (t[:, None] / scale) ** np.array(powers)
    inverse = np.linalg.pinv(columns)
    coefficients = inverse @ y
    residual = y - columns @ coefficients
    moving = 1 in powers
    return _Polynomial(
        value=float(coefficients[0]),
        rate=float(coefficients[1] / scale) if moving else 0.0,
        value_error=float(np.linalg.norm(inverse[0])),
        rate_error=float(np.linalg.norm(inverse[1])) / scale if moving else 0.0,
        squares=float(residual @ residual),
        samples=len(t),
        free=len(t) - len(powers),
    )


class Window(NamedTuple):
    """Samples of a run from `first` to before `stop`, what its `start` is, and what that may well
    be `off` by."""

    first: int
    stop: int
    start: Mapping[str, float]
    off: Mapping[str, float]

    def moved(self, name: str) -> Window:
        """The window with this one of its start off; as it is for one that it has not."""
        if name not in self.off:
            return self
        return self._replace(start={**self.start, name: self.start[name] + self.off[name]})


def by_window(
    base: Mapping[str, Array], moved: Mapping[str, Array], seams: Sequence[int]
) -> Iterator[dict[str, Array]]:
    """`base` with `moved` in one window after the other, where that is another and finite."""
    stop = len(next(iter(base.values())))
    for a, b in pairwise([*seams, stop]):
        change = np.stack([moved[n][a:b] - y[a:b] for n, y in base.items()])
        if change.any() and np.isfinite(change).all():
            yield {n: np.r_[y[:a], moved[n][a:b], y[b:]] for n, y in base.items()}


class Starts:
    """Of one run: what its outputs show at any sample, smoothed; 0 for an output that it lacks."""

    def __init__(self, run: GapRun, outputs: tuple[str, ...]) -> None:
        self._run = run
        self._outputs = outputs
        measured = {n: run.outputs[n] for n in outputs if n in run.outputs}
        self._half = {
            n: int(
                np.clip(_OF_CORRELATION * correlation_time_s(run.t_s, y) / run.dt_s, _FEWEST, _MOST)
            )
            for n, y in measured.items()
        }
        self._variance = {
            n: third_difference_sd([y]) ** 2
            + quantum_of([y]) ** 2 / 12.0
            + (_RESOLUTION * np.ptp(y)) ** 2
            for n, y in measured.items()
        }

    def start_of(self, k: int) -> tuple[Mapping[str, float], Mapping[str, float]]:
        """NAME and NAME_rate of every output at sample k, and what they may be off by."""
        start: dict[str, float] = {}
        off: dict[str, float] = {}
        for name in self._outputs:
            start |= {name: 0.0, f"{name}_rate": 0.0}
            if name not in self._half:
                continue
            if best := self._local(name, k):
                sd = _OFF * float(np.sqrt(self._variance[name]))
                start |= {name: best.value, f"{name}_rate": best.rate}
                off |= {name: sd * best.value_error, f"{name}_rate": sd * best.rate_error}
            else:
                start[name] = float(np.nan_to_num(self._run.outputs[name][k]))
        return start, off

    def _local(self, name: str, k: int) -> _Polynomial | None:
        moving = self._fits(name, k, _MOVING)
        if not moving:
            return None
        variance = self._variance[name]
        able = [f for f in moving if not f.contradicted(variance)]
        best = min(able, key=lambda f: f.rate_error) if able else moving[-1]
        at_rest = self._fits(name, k, _AT_REST) if k == 0 else []
        still = [f for f in at_rest if not f.contradicted(variance)]
        # That over most samples; of these the one that leaves least.
        longest = min([*able, *still], key=lambda f: (-f.samples, f.squares), default=best)
        if longest in still:
            # That it rests may be wrong, too.
            best = replace(longest, rate_error=best.rate_error)
        return best

    def _fits(self, name: str, k: int, powers: Sequence[tuple[int, ...]]) -> list[_Polynomial]:
        """Polynomials of these powers over each number of samples, the longest cubic last."""
        run, y, out = self._run, self._run.outputs[name], []
        for half in sorted({max(_FEWEST, round(s * self._half[name])) for s in _SIZES}):
            part = slice(max(k - half, 0), min(k + half + 1, len(run.t_s)))
            good = run.good[part] & np.isfinite(y[part])
            t: Array = (run.t_s[part] - run.t_s[k])[good]
            out += [_fit(t, y[part][good], p) for p in powers if len(t) > len(p)]
        return out


class Windows:
    """Of each run the windows in which it is replayed, begun from what `outputs` show there."""

    def __init__(self, outputs: tuple[str, ...]) -> None:
        self._outputs = outputs
        self._cut_runs: dict[object, tuple[GapRun, list[Window]]] = {}

    def of(self, run: GapRun, window_s: float) -> list[Window]:
        """Windows of `window_s` of a run, thinned or not; 0: one, from its start to its end.

        One that is pushed, or has other inputs, has the same times and readings, and so the same
        windows.
        """
        whole = run.as_recorded
        key = (id(run.t_s), self.readings_of(whole), window_s)
        if key not in self._cut_runs:
            # The run is kept as well, so that nothing else gets its numbers.
            self._cut_runs[key] = (run, self._cut(run.t_s, whole, window_s))
        return self._cut_runs[key][1]

    def readings_of(self, whole: GapRun) -> tuple[int, ...]:
        """Numbers of the arrays from which the windows of a run begin, while these exist."""
        columns = (whole.t_s, whole.valid, *(whole.outputs.get(n) for n in self._outputs))
        return tuple(map(id, columns))

    def _cut(self, t_s: Array, whole: GapRun, window_s: float) -> list[Window]:
        starts = Starts(whole, self._outputs)
        edges = [0]
        if window_s > 0.0:
            number = np.floor((t_s - t_s[0]) / window_s + 1e-9)
            edges += [int(k) + 1 for k in np.flatnonzero(np.diff(number) > 0)]
        free = 2 * len(self._outputs) * len(edges) <= _MOST_FREE
        out = []
        for a, b in pairwise([*edges, len(t_s)]):
            start, off = starts.start_of(int(np.searchsorted(whole.t_s, t_s[a])))
            out.append(Window(a, b, MappingProxyType(dict(start)), off if free else {}))
        return out
