"""Least squares from far away, where many parameters move at once and the replay is rough.

Slopes are taken along the axes of what the fit leaves open, not along the parameters: a parameter
that acts strongly would have to be moved so little that roughness shows, and one that hardly acts
so far that it says nothing of here. Each step is as long as changes the prediction by a share of
what is left of the misfit, so that the slopes are smooth over what is still to go, and sharpen as
the fit comes close.

Each set of slopes is used for several steps, as far as they foretell what happens; in between the
slopes learn from the steps by Broyden's rule. Every step is tried with three dampings at once.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.replay import Detail
from smad.gap.fit.lsq import (
    Ask,
    FitResult,
    FitSteps,
    Problem,
    edges,
    lesson,
    objective,
    parabola,
    solve_box,
    teaches,
)
from smad.gap.model.space import Space
from smad.gap.plant import Array

_STEPS_PER_ROUND = 4
_FORETOLD = 0.3
_SHARE = 0.3
_RUNGS = (0.03, 0.3, 3.0)
_STIFFER = 1e3
_FIRST_DAMPING, _LEAST_DAMPING = 1e-2, 1e-5
_FRUITLESS = 2
_TOLERANCE = 2.0


def descent(
    problem: Problem,
    space: Space,
    start: Array,
    *,
    rounds: int,
) -> FitSteps:
    """Steps of a least-squares fit from `start`; returns a `FitResult`, its end replayed as usual.

    Replays on the way are rough. At most `rounds` sets of slopes. A round that gains little halves
    the steps of the next; after two such rounds the fit ends. The objective is that of `lsq` with a
    floor as large as the misfit.

    What rough replays cost changes over so long a way: it is measured anew before each round, by a
    quicker replay than in full detail, with which only the end is made.
    """
    way = _Way(problem, space)
    p = np.clip(start, *space.bounds())
    axes, share, total, fruitless = np.diag(space.steps(p)), _SHARE, 0.0, 0
    for _ in range(rounds):
        here = space.point(p)
        predicted = (yield Ask(problem.dataset, [here]))[0]
        way.problem = problem.matching(here, predicted)
        yield from way.begin(p)
        A = yield from way.slopes(axes)
        gained, around = yield from way.go_by(A)
        p = way.p
        total += gained
        if gained < max(_TOLERANCE, 0.003 * total):
            share, fruitless = 0.5 * share, fruitless + 1
            if fruitless == _FRUITLESS:
                break
        else:
            fruitless = 0
        axes = _axes(space, way, around, share)
    problem = problem.calibrated(space.point(p))
    predicted = (yield Ask(problem.dataset, [space.point(way.p)]))[0]
    z = problem.white(predicted)
    value = objective(problem, space, way.p, z)
    return FitResult(problem, space, way.p, predicted, z, way.A, value, edges(space, way.p))


@dataclass(frozen=True)
class _Parabola:
    """Least squares around a place: H and g of the objective ½ xᵀHx − gᵀx, and its row weights."""

    H: Array
    g: Array
    weight: Array

    def step(self, damping: float, lo: Array, hi: Array) -> Array:
        """Where it is least within the bounds, damped."""
        return solve_box(self.H + damping * np.diag(np.diag(self.H)), self.g, lo, hi)

    def foretells(self, step: Array) -> float:
        """By how much the objective should fall."""
        return float(self.g @ step - 0.5 * step @ self.H @ step)


class _Way:
    """Where a descent has come to: coordinates, rough prediction, white residual, slopes."""

    def __init__(self, problem: Problem, space: Space) -> None:
        self.problem, self.space = problem, space
        self.lo, self.hi = space.bounds()
        self.damping = _FIRST_DAMPING
        self.A = np.zeros((problem.dataset.n, space.size), dtype=np.float32)

    def replayed(self, points: list[Array]) -> Generator[Ask, Array, Array]:
        """Predictions at these coordinates."""
        return (
            yield Ask(self.problem.dataset, [self.space.point(p) for p in points], Detail.ROUGH)
        )

    def begin(self, p: Array) -> Generator[Ask, Array, None]:
        """Take a place to start from."""
        self.p, self.predicted = p, (yield from self.replayed([p]))[0]
        self.z = self.problem.white(self.predicted)

    def slopes(self, axes: Array) -> Generator[Ask, Array, NDArray[np.float32]]:
        """White sensitivities of all coordinates, from differences along the columns of `axes`.

        A step that leaves the bounds is cut off there, or taken backwards if that leaves more of
        it; so is one to where the plant cannot be simulated.
        """

        def within(step: Array) -> Array:
            return np.asarray(np.clip(self.p + step, self.lo, self.hi) - self.p)

        taken = []
        for step in axes.T:
            forth, back = within(step), within(-step)
            taken.append(forth if forth @ forth >= back @ back else back)
        values = yield from self.replayed([self.p + step for step in taken])
        ev = self.problem.dataset
        failed = [i for i, y in enumerate(values) if ev.fails(y, Detail.ROUGH)]
        if failed:
            for i in failed:
                taken[i] = within(-taken[i])
            values[failed] = yield from self.replayed([self.p + taken[i] for i in failed])
        change = ev.change(values, self.predicted, Detail.ROUGH)
        white = self.problem.whitening.white(np.ascontiguousarray(change.T))
        return (white @ np.linalg.pinv(np.array(taken).T, rcond=1e-9)).astype(np.float32)

    def go_by(self, A: NDArray[np.float32]) -> Generator[Ask, Array, tuple[float, _Parabola]]:
        """Go on as long as these slopes, taught by every step, foretell what happens.

        Returns what was gained, and the parabola of the last place but one or so.
        """
        self.A = A
        heat = max(1.0, self.problem.misfit(self.z))
        first = value = objective(self.problem, self.space, self.p, self.z, heat)
        for n in range(_STEPS_PER_ROUND):
            around = _Parabola(
                *parabola(self.problem, self.space, self.p, self.z, self.A, heat=heat)
            )
            new, foretold = yield from self._step(around, value, heat, far=n == 0)
            fell, value = value - new, new
            if fell < max(_FORETOLD * foretold, _TOLERANCE):
                break
        return first - value, around

    def _step(
        self, around: _Parabola, value: float, heat: float, *, far: bool
    ) -> Generator[Ask, Array, tuple[float, float]]:
        """The best of three dampings, and if none is better and `far`, of three much larger ones.

        Returns the objective after it, and by how much it should have fallen.
        """
        for stiffer in (1.0, _STIFFER) if far else (1.0,):
            ladder = [self.damping * stiffer * rung for rung in _RUNGS]
            steps = [around.step(d, self.lo - self.p, self.hi - self.p) for d in ladder]
            values = yield from self.replayed([self.p + step for step in steps])
            ends = [self.problem.white(y) for y in values]
            scores = [
                objective(self.problem, self.space, self.p + step, z, heat)
                for step, z in zip(steps, ends, strict=True)
            ]
            best = int(np.argmin(scores))
            if scores[best] < value:
                break
        step, z = steps[best], ends[best]
        if teaches(self.problem, step, values[best], Detail.ROUGH):
            self.A = self.A + lesson(self.A, step, self.z - z)
        foretold = around.foretells(step)
        if not scores[best] < value:
            if far:
                self.damping *= 10.0
            return value, foretold
        self.damping = max(ladder[best], _LEAST_DAMPING)
        self.p, self.predicted, self.z = self.p + step, values[best], z
        return scores[best], foretold


def _axes(space: Space, way: _Way, around: _Parabola, share: float) -> Array:
    """Steps along the axes of the parabola, one a column; shape (k, k).

    No coordinate moves further than its own finite-difference step.
    """
    curvature, axes = np.linalg.eigh(around.H)
    left = float(np.sqrt(np.sum(around.weight * np.square(way.z))))
    lengths = share * left / np.sqrt(np.maximum(curvature, 1e-12))
    steps = axes * lengths
    most = np.max(np.abs(steps) / space.steps(way.p)[:, None], axis=0)
    return np.asarray(steps / np.maximum(1.0, most))
