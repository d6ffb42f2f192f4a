"""Robust, bounded, damped least squares over cells, written so that many fits can share replays.

The objective marginalises an unknown scale of each cell (a block of rows of one output):

    L(p) = Σ_c (ν + n_c)/2 · log(1 + q_c/ν) + ½ (p − m)ᵀ Λ (p − m),   q_c = Σ_{rows of c} z²

A cell that only the wrong form of the model can explain then weighs (ν + n_c)/(ν + q_c): as much as
its floor when it fits, little when it does not.

The fit begins with a floor as large as the misfit, which is least squares, and cools down from
there: begun cold it would stay with the cells that happen to fit.

A fit is a generator: it yields model points and is sent their predictions. `drive` runs many such
generators in turns, so that the workers always have replays to make.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.replay import Dataset, Detail
from smad.gap.model.space import Space
from smad.gap.model.whiten import Whitening
from smad.gap.plant import Array, Effect, Mask, ModelPoint

_RENEWALS = (0, 2, 5)
_TELLING_STEP = 0.1
_COOLING = (1.0, 0.5, 0.15)
_FIRST_DAMPING, _DAMPINGS = 1e-3, 4
ROUGHLY = 2.0
"""Nats that another step must gain for most fits to go on."""


@dataclass(frozen=True, slots=True)
class Ask:
    """Points that a fit wants replayed by its evidence, and how finely (None: as that is)."""

    dataset: Dataset
    points: list[ModelPoint]
    detail: Detail | None = None


FitSteps = Generator[Ask, Array, "FitResult"]
End = TypeVar("End")


@dataclass(frozen=True)
class Problem:
    """Evidence, its weights, and what is subtracted from it as known background."""

    dataset: Dataset
    whitening: Whitening
    background: Array

    def calibrated(self, point: ModelPoint) -> Problem:
        """The same problem, whose coarser replays are right at `point`."""
        return replace(self, dataset=self.dataset.calibrated(point))

    def matching(self, point: ModelPoint, predicted: Array) -> Problem:
        """The same problem, whose rough replays agree at `point` with `predicted`."""
        return replace(self, dataset=self.dataset.matching(point, predicted))

    def white(self, predicted: Array) -> Array:
        """White residual of one prediction."""
        return self.whitening.white(self.dataset.residual(predicted + self.background))

    def scaled(self, predicted: Array) -> Array:
        """Residual over its standard deviation, not filtered."""
        return self.whitening.scale(self.dataset.residual(predicted + self.background))

    def cell_q(self, z: Array) -> Array:
        """Sum of squares in each cell."""
        return self.dataset.cell_sum(z * z)

    def cell_score(self, z: Array, heat: float = 1.0) -> Array:
        """Log-likelihood of each cell up to a constant, its scale marginalised.

        With `heat` above 1 the floor is taken so many times larger: cells far off still count.
        """
        nu, n = self.dataset.settings.cell_dof, self.dataset.cell_size
        return -0.5 * (nu + n) * np.log1p(self.cell_q(z) / (nu * heat**2)) * (n > 0)

    def cell_weight(self, z: Array, heat: float = 1.0) -> Array:
        """How much each cell weighs in a least-squares step."""
        nu, n = self.dataset.settings.cell_dof, self.dataset.cell_size
        return (nu + n) / (nu * heat**2 + self.cell_q(z)) * (n > 0)

    def row_weight(self, z: Array, heat: float = 1.0) -> Array:
        """`cell_weight` spread over the rows."""
        return self.cell_weight(z, heat)[self.dataset.row_cell]

    def misfit(self, z: Array) -> float:
        """Root mean square of the white residual."""
        return float(np.sqrt(np.sum(z * z) / max(float(self.dataset.cell_size.sum()), 1.0)))


@dataclass(frozen=True)
class FitResult:
    """End of a fit: coordinates, prediction, white residual, white sensitivities A = d(pred)/dp.

    `problem` carries the correction of the coarse step that the fit was made with.
    """

    problem: Problem
    space: Space
    p: Array
    predicted: Array
    z: Array
    A: NDArray[np.float32]
    objective: float
    at_bound: tuple[bool, ...]

    @property
    def point(self) -> ModelPoint:
        return self.space.point(self.p)

    def recalibrated(self) -> FitResult:
        """The same fit, whose coarser replays are right at its own point from now on."""
        return replace(self, problem=self.problem.calibrated(self.point))

    def without(self, name: str) -> ModelPoint:
        """Its point, with one effect as it was in known-good runs, which is mostly absent."""
        point, known = self.point, self.space.fixed.get(name)
        rest = {k: v for k, v in point.effects.items() if k != name}
        return replace(point, effects=rest if known is None else {**rest, name: known})

    def beside(
        self, effects: Sequence[Effect], values: Mapping[str, Mapping[str, float]]
    ) -> tuple[Space, Array]:
        """Space and start of a fit with these effects, the parameters as they are here."""
        space = self.space.with_effects(effects)
        p = space.start(values)
        p[: space.n_theta] = self.p[: space.n_theta]
        return space, p

    def normal_equations(self) -> tuple[Array, Array]:
        """H (cells, k, k) and g (cells, k) of the weighted least squares around `p`."""
        ev = self.problem.dataset
        w = self.problem.cell_weight(self.z)
        k = self.space.size
        H, g = np.zeros((len(w), k, k)), np.zeros((len(w), k))
        for c, (a, b) in enumerate(zip(ev.cell_starts, ev.cell_stops, strict=True)):
            part = self.A[a:b].astype(np.float64)
            H[c] = w[c] * part.T @ part
            g[c] = w[c] * part.T @ self.z[a:b]
        return H, g


def solve_box(H: Array, g: Array, lo: Array, hi: Array) -> Array:
    """Minimiser of ½ xᵀHx − gᵀx within lo ≤ x ≤ hi, for H symmetric positive definite.

    Active set: fix what leaves the box, free what the gradient pulls back inside. Shape (k,).
    """
    k = len(g)
    x = np.zeros(k)
    fixed = np.zeros(k, dtype=int)
    for _ in range(3 * k + 3):
        free = fixed == 0
        x[fixed < 0], x[fixed > 0] = lo[fixed < 0], hi[fixed > 0]
        if free.any():
            rhs = g[free] - H[np.ix_(free, ~free)] @ x[~free]
            x[free] = np.linalg.solve(H[np.ix_(free, free)], rhs)
        out_low, out_high = free & (x < lo - 1e-12), free & (x > hi + 1e-12)
        if out_low.any() or out_high.any():
            fixed[out_low], fixed[out_high] = -1, 1
            continue
        slope = g - H @ x
        wrong = ((fixed < 0) & (slope > 1e-9)) | ((fixed > 0) & (slope < -1e-9))
        if not wrong.any():
            break
        fixed[np.argmax(np.where(wrong, np.abs(slope), 0.0))] = 0
    return np.clip(x, lo, hi)


def objective(
    problem: Problem,
    space: Space,
    p: Array,
    z: Array,
    heat: float = 1.0,
    *,
    cells: Mask | None = None,
) -> float:
    """L(p), up to a constant; over some of the cells, if they are given."""
    mean, precision = space.prior()
    off = p - mean
    scores = problem.cell_score(z, heat)
    if cells is not None:
        scores = scores[cells]
    return float(-scores.sum() + 0.5 * off @ precision @ off)


def sensitivities(
    problem: Problem,
    space: Space,
    p: Array,
    columns: Sequence[int],
    *,
    detail: Detail | None = None,
    predicted: Array | None = None,
) -> Generator[Ask, Array, NDArray[np.float32]]:
    """White finite-difference sensitivities of `columns`; shape (rows, columns).

    `predicted` is the prediction at `p` in the same detail, if it is known.
    """
    lo, hi = space.bounds()
    reach = space.steps(p)
    wanted = [
        reach[i] if p[i] + reach[i] <= hi[i] else -min(reach[i], p[i] - lo[i]) for i in columns
    ]

    def beside(i: int, h: float) -> ModelPoint:
        q = p.copy()
        q[i] += h
        return space.point(q)

    points = [beside(i, h) for i, h in zip(columns, wanted, strict=True)]
    values = yield Ask(
        problem.dataset, points if predicted is not None else [*points, space.point(p)], detail
    )
    here = values[-1] if predicted is None else predicted
    values, signed = values[: len(points)], np.array(wanted)
    # A parameter may stand at the edge of what is physical: then its slope is that on the inside.
    ev = problem.dataset
    over = [
        k
        for k, i in enumerate(columns)
        if ev.fails(values[k], detail) and lo[i] <= p[i] - signed[k] <= hi[i]
    ]
    if over:
        signed[over] *= -1.0
        values[over] = yield Ask(ev, [beside(columns[k], signed[k]) for k in over], detail)
    diff = ev.change(values, here, detail) / signed[:, None]
    white = problem.whitening.white(np.ascontiguousarray(diff.T))
    return white.astype(np.float32)


def fitting(
    problem: Problem,
    space: Space,
    start: Array,
    *,
    theta_A: NDArray[np.float32] | None = None,
    iterations: int = 8,
    refresh_theta: bool = False,
    tolerance: float = ROUGHLY,
    pinned: Mapping[int, float] | None = None,
    squares: bool = False,
    rough: bool = False,
) -> FitSteps:
    """Steps of a fit from `start`; returns a `FitResult`.

    `theta_A` are sensitivities of the model parameters to begin with; without them they are
    computed. They follow by Broyden's rule; with `refresh_theta` they are renewed after some
    iterations, and before the fit gives up. Those of the effects are renewed in each iteration, in
    a rough fit in some.
    `pinned` coordinates stay at the values given (a profile). `squares` keeps the floor as large as
    the misfit: least squares to the end.

    Sensitivities of the model parameters come from rough replays. With `rough` the whole fit does;
    its end is replayed in detail.
    """
    fit = _Fit(problem, space, Detail.ROUGH if rough else None, pinned or {})
    yield from fit.begin(start, theta_A)
    total, stuck = 0.0, False
    for iteration in range(iterations + len(_COOLING)):
        cooling = _COOLING[iteration] if iteration < len(_COOLING) else 0.0
        heat = max(1.0, (1.0 if squares else cooling) * problem.misfit(fit.z))
        due = stuck or iteration in _RENEWALS
        fresh = due or not rough
        if refresh_theta and due and iteration > 0:
            yield from fit.renew_own()
        if fresh:
            yield from fit.renew_extra()
        gained = yield from fit.step(heat)
        total += gained
        stuck = (heat == 1.0 or squares) and gained < max(tolerance, 0.003 * total)
        # Slopes that have grown old are renewed before a fit gives up.
        if stuck and fresh:
            break
    return (yield from fit.end())


class _Fit:
    """Where a fit has come to: coordinates, prediction, white residual, sensitivities, damping."""

    def __init__(
        self,
        problem: Problem,
        space: Space,
        detail: Detail | None,
        pinned: Mapping[int, float],
    ) -> None:
        self.problem, self.space, self.detail = problem, space, detail
        self.lo, self.hi = space.bounds()
        for i, value in pinned.items():
            self.lo[i] = self.hi[i] = value
        self.own = list(range(space.n_theta))
        self.extra = [i for i in range(space.n_theta, space.size) if i not in pinned]
        self.A = np.zeros((problem.dataset.n, space.size), dtype=np.float32)
        self.damping = _FIRST_DAMPING

    def begin(
        self, start: Array, theta_A: NDArray[np.float32] | None
    ) -> Generator[Ask, Array, None]:
        """Takes the place to start from, and the parameters' sensitivities there."""
        self.p = np.clip(start, self.lo, self.hi)
        yield from self._replay(self.detail)
        if theta_A is None:
            yield from self.renew_own()
        else:
            self.A[:, : self.space.n_theta] = theta_A

    def _replay(self, detail: Detail | None) -> Generator[Ask, Array, None]:
        self.predicted = (yield Ask(self.problem.dataset, [self.space.point(self.p)], detail))[0]
        self.z = self.problem.white(self.predicted)

    def renew_own(self) -> Generator[Ask, Array, None]:
        """Sensitivities of the model parameters, roughly."""
        if self.own:
            self.A[:, self.own] = yield from sensitivities(
                self.problem, self.space, self.p, self.own, detail=Detail.ROUGH
            )

    def renew_extra(self) -> Generator[Ask, Array, None]:
        """Sensitivities of the effects, in the detail of the fit."""
        if self.extra:
            self.A[:, self.extra] = yield from sensitivities(
                self.problem,
                self.space,
                self.p,
                self.extra,
                detail=self.detail,
                predicted=self.predicted,
            )

    def step(self, heat: float) -> Generator[Ask, Array, float]:
        """One step downhill, damped the more the less that helps; returns what it gained."""
        problem, space, p = self.problem, self.space, self.p
        best = objective(problem, space, p, self.z, heat)
        H, g, _ = parabola(problem, space, p, self.z, self.A, heat=heat)
        for _ in range(_DAMPINGS):
            damped = H + self.damping * np.diag(np.diag(H))
            step = solve_box(damped, g, self.lo - p, self.hi - p)
            if not np.any(np.abs(step) > 1e-7):
                break
            trial = (yield Ask(problem.dataset, [space.point(p + step)], self.detail))[0]
            z = problem.white(trial)
            value = objective(problem, space, p + step, z, heat)
            if teaches(problem, step, trial, self.detail):
                self.A += lesson(self.A, step, self.z - z)
            if value < best:
                self.p, self.predicted, self.z = p + step, trial, z
                self.damping = max(self.damping / 10, 1e-6)
                return best - value
            self.damping = max(10 * self.damping, 0.03)
        return 0.0

    def end(self) -> FitSteps:
        """The fit as it stands, replayed in detail."""
        if self.detail is not None:
            yield from self._replay(None)
        problem, space, p = self.problem, self.space, self.p
        value = objective(problem, space, p, self.z)
        return FitResult(problem, space, p, self.predicted, self.z, self.A, value, edges(space, p))


def parabola(
    problem: Problem, space: Space, p: Array, z: Array, A: NDArray[np.float32], *, heat: float
) -> tuple[Array, Array, Array]:
    """H (k, k) and g (k,) of the objective ½ xᵀHx − gᵀx around `p`, and the weights of its rows."""
    mean, precision = space.prior()
    w = problem.row_weight(z, heat)
    weighted = A * np.sqrt(w).astype(np.float32)[:, None]
    H = (weighted.T @ weighted).astype(np.float64) + precision
    g = ((w * z).astype(np.float32) @ A).astype(np.float64) - precision @ (p - mean)
    return H, g, w


def lesson(A: NDArray[np.float32], step: Array, seen: Array) -> NDArray[np.float32]:
    """What a step that took `seen` off the white residual adds to the slopes (Broyden)."""
    missed = (seen - A @ step.astype(np.float32)).astype(np.float32)
    return np.outer(missed, (step / (step @ step)).astype(np.float32))


def edges(space: Space, p: Array) -> tuple[bool, ...]:
    """Which coordinates stand at a bound; an effect that is absent does not."""
    lo, hi = space.bounds()
    edge = 1e-6 * np.maximum(1.0, hi - lo)
    off = np.array([i >= space.n_theta for i in range(space.size)]) & (np.abs(p) < 1e-9)
    at_bound = ((p <= lo + edge) | (p >= hi - edge)) & ~off
    return tuple(at_bound.tolist())


def teaches(problem: Problem, step: Array, trial: Array, detail: Detail | None) -> bool:
    """Whether a step says something of the slopes.

    Over a short one a hysteretic replay shows its roughness, divided by the step; a run that could
    not be simulated shows nothing.
    """
    telling = float(np.linalg.norm(step)) >= _TELLING_STEP
    return telling and not problem.dataset.fails(trial, detail)


def drive(fits: Sequence[Generator[Ask, Array, End]]) -> list[End]:
    """Runs fits, or parts of fits, in turns and returns their ends, in order.

    What one fit makes of its replays is worked out while those of the next are made.
    """
    done: list[End | None] = [None] * len(fits)
    waiting = deque((i, _asked(next(fit))) for i, fit in enumerate(fits))
    while waiting:
        i, replays = waiting.popleft()
        try:
            waiting.append((i, _asked(fits[i].send(replays()))))
        except StopIteration as end:
            done[i] = end.value
    return [fit for fit in done if fit is not None]


def _asked(ask: Ask) -> Callable[[], Array]:
    return ask.dataset.predicting(ask.points, detail=ask.detail)


def fitted(problem: Problem, space: Space, start: Array, **options: Any) -> FitResult:
    """The end of one `fitting` with these options, run by itself."""
    return drive([fitting(problem, space, start, **options)])[0]
