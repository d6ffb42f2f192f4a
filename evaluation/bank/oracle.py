"""What remains of a gap after this plant itself, without the effect, is refitted to the data.

This sets the strength of an effect and the best that anybody can reach (oracle O1): both know the
true plant, so that neither flatters the diagnosis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evaluation.bank.recorder import Run
from evaluation.plant.effects import Active, magnitudes
from evaluation.plant.kernel import simulate
from evaluation.plant.parameters import REFITTED, SHIFTED_K, Bench

Array = NDArray[np.float64]

SIGNALS = (
    "i_meas_x_A",
    "i_meas_y_A",
    "v_x_V",
    "v_y_V",
    "rtd_x_degC",
    "rtd_y_degC",
    "displacement_mm",
    "force_N",
)
COLUMN = (0, 1, 2, 3, 4, 5, 8, 9)
SCALE = np.array([2.3e-3, 2.3e-3, 2.3e-3, 2.3e-3, 0.05, 0.05, 0.03, 2.5e-3])
"""Weights of the refit only; the floors that gaps are divided by are measured."""

BLOCK_s = 0.2
TICK_s = 0.01
COARSE = 10  # ticks at a time: for slopes
FINE = 2  # for residuals
REFIT_STEPS = 3
RELINEARISED = 2
FAR = 1.0


@dataclass(frozen=True)
class Gap:
    """Held-out excess of each of `SIGNALS` over its floor, in floors."""

    by_signal: Array

    @property
    def worst(self) -> float:
        """The gap of the signal that shows it most."""
        return float(self.by_signal.max())


@dataclass(frozen=True)
class Slopes:
    """Sensitivities (see :func:`sensitivities`) and the steps at which they were taken."""

    jacobian: Array
    at: Array


@dataclass(frozen=True)
class Refit:
    """Refitted constants (as steps of their priors), and held-out mean squares by signal."""

    steps: Array
    scale: float  # of the effect's magnitude, where it was fitted
    held_out: Array
    slopes: "Slopes"  # as they were last taken


def moved(bench: Bench, steps: Array) -> Bench:
    """The bench with its refittable constants moved by `steps` standard deviations of the prior."""
    changes: dict[str, float] = {}
    for (name, relative), step in zip(REFITTED.items(), steps, strict=True):
        value = getattr(bench, name)
        if name in SHIFTED_K:
            changes[name] = value + 2.5 * float(step)
        else:
            changes[name] = value * float(np.exp(relative * step))
    return replace(bench, **changes)


def _predicted(bench: Bench, run: Run, effects: Array, every: int = 1) -> Array:
    """The plant's answer to a run's inputs, averaged over `every` ticks and stepped so."""
    n = len(run.inputs) // every * every
    inputs = run.inputs[:n].reshape(-1, every, run.inputs.shape[1]).mean(axis=1)
    out = simulate(bench, inputs, TICK_s * every, effects)
    return np.stack([out[name] for name in SIGNALS], axis=1)


def _blocks(values: Array, dt: float) -> Array:
    width = round(BLOCK_s / dt)
    count = len(values) // width
    means = values[: count * width].reshape(count, width, -1).mean(axis=1)
    return np.asarray((means / SCALE).ravel())


def _sketch(bench: Bench, runs: Sequence[Run], effects: Array, every: int) -> Array:
    """Block means of all runs, replayed `every` ticks at a time, in one column."""
    blocks = [_blocks(_predicted(bench, r, effects, every), TICK_s * every) for r in runs]
    return np.concatenate(blocks)


def _scaled(active: tuple[Active, ...], scale: float) -> Array:
    """Magnitude array with every effect scaled alike."""
    return magnitudes(tuple(replace(a, magnitude=a.magnitude * scale) for a in active))


def slopes_at(bench: Bench, runs: Sequence[Run], active: tuple[Active, ...] = ()) -> Slopes:
    """Sensitivities at the bench's own constants."""
    return Slopes(sensitivities(bench, runs, active), np.zeros(len(REFITTED)))


def sensitivities(bench: Bench, runs: Sequence[Run], active: tuple[Active, ...] = ()) -> Array:
    """Change of all block means per prior standard deviation, one column a constant.

    With `active` effects, a last column is the change per relative change of their magnitude;
    the other columns are taken without them, as fast and random effects do not survive the
    coarse steps.
    """
    effects = magnitudes()
    base = _sketch(bench, runs, effects, COARSE)
    columns = []
    for j in range(len(REFITTED)):
        step = np.zeros(len(REFITTED))
        step[j] = 0.1
        columns.append((_sketch(moved(bench, step), runs, effects, COARSE) - base) / 0.1)
    if active:
        up, down = (_sketch(bench, runs, _scaled(active, s), 1) for s in (1.03, 0.97))
        columns.append((up - down) / 0.06)
    return np.stack(columns, axis=1)


def _squares(bench: Bench, runs: Sequence[Run], effects: Array) -> Array:
    """Mean square residual of each signal, sample by sample."""
    off = [run.grid[:, COLUMN] - _predicted(bench, run, effects) for run in runs]
    return np.asarray(np.mean([(o**2).mean(axis=0) for o in off], axis=0))


def refit(
    bench: Bench,
    fit: Sequence[Run],
    held_out: Sequence[Run],
    slopes: Slopes,
    *,
    active: tuple[Active, ...] = (),
    start_scale: float = 1.0,
    start: Array | None = None,
) -> Refit:
    """Fit the constants to `fit` within their priors, from `start`; judge on `held_out`.

    `slopes` are kept while the fit stays near where they were taken, and taken anew, at most
    twice, where it has moved by more than one prior deviation. With `active` the Jacobian has one
    column more and the magnitudes' common scale is fitted too.
    """
    count = len(REFITTED)
    task = _Task(bench, tuple(fit), active)
    x = np.zeros(count + bool(active))
    if start is not None:
        x[:count] = start
    if active:
        x[-1] = start_scale - 1.0
    point = task.evaluate(x)
    for _ in range(1 + RELINEARISED):
        x, point = _descend(task, x, point, slopes.jacobian)
        if np.abs(x[:count] - slopes.at).max() < FAR:
            break
        here = moved(bench, x[:count])
        slopes = Slopes(sensitivities(here, fit, task.scaled(x)), x[:count].copy())
    unseen = _squares(moved(bench, x[:count]), held_out, magnitudes(task.scaled(x)))
    return Refit(x[:count], 1.0 + float(x[-1]) if active else 1.0, unseen, slopes)


@dataclass(frozen=True)
class _Point:
    cost: float
    off: Array


@dataclass(frozen=True)
class _Task:
    bench: Bench
    runs: tuple[Run, ...]
    active: tuple[Active, ...]

    def prior(self) -> Array:
        weights = np.ones(len(REFITTED) + bool(self.active))
        if self.active:
            weights[-1] = 1e-4
        return weights

    def scaled(self, x: Array) -> tuple[Active, ...]:
        return tuple(replace(a, magnitude=a.magnitude * (1.0 + x[-1])) for a in self.active)

    def evaluate(self, x: Array) -> _Point:
        bench = moved(self.bench, x[: len(REFITTED)])
        seen = np.concatenate([_blocks(run.grid[:, COLUMN], TICK_s) for run in self.runs])
        every = 1 if self.active else FINE
        off = seen - _sketch(bench, self.runs, magnitudes(self.scaled(x)), every)
        return _Point(float(off @ off + self.prior() @ x**2), off)


def _descend(task: _Task, x: Array, here: _Point, jacobian: Array) -> tuple[Array, _Point]:
    """Gauss–Newton with a kept Jacobian; each step is halved once if it does not help."""
    prior = task.prior()
    normal = jacobian.T @ jacobian + np.diag(prior)
    for _ in range(REFIT_STEPS):
        step = np.linalg.solve(normal, jacobian.T @ here.off - prior * x)
        step *= min(1.0, 2.0 / max(float(np.abs(step[: len(REFITTED)]).max()), 1e-12))
        step[len(REFITTED) :] = np.clip(step[len(REFITTED) :], -0.3, 0.3)
        for shorter in (1.0, 0.4):
            there = task.evaluate(x + shorter * step)
            if there.cost < here.cost:
                break
        else:
            break
        gained = here.cost - there.cost
        x, here = x + shorter * step, there
        if gained < 5e-3 * here.cost:
            break
    return x, here


def unfitted(bench: Bench, held_out: Sequence[Run]) -> Array:
    """Mean square residual of each signal with the bench's constants as they are."""
    return _squares(bench, held_out, magnitudes())


def excess(mean_squares: Array, floor_squares: Array) -> Gap:
    """Gap above the floor, in floors: sqrt(max(0, MSE − floor²))/floor for each signal."""
    return Gap(np.sqrt(np.maximum(0.0, mean_squares / floor_squares - 1.0)))
