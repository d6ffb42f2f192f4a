"""K_δ: how wrong the model is when nothing is wrong with the bench, learnt from known-good runs.

Three parts, each by output: the floor of a view that is fed with noisy measurements (by
simulation), a background template (what of the residual of good runs depends on state, accepted
only if it predicts good runs left out), and the size of the remainder by regime with its
correlation time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.gap.data.noise import Floor
from smad.gap.data.replay import Dataset, Detail
from smad.gap.fit.deficit import Usual, usual_of
from smad.gap.fit.leave_out import LeftOut, left_out
from smad.gap.fit.lsq import FitResult, Problem
from smad.gap.model.flexible import Correction, Designs, fit_correction
from smad.gap.model.whiten import OutputNoise, Whitening, lagged_products
from smad.gap.plant import Array, ModelPoint
from smad.gap.runs import GapRun

_LONGEST_LAG = 200
_TEMPLATE_SHARE = 0.2
"""Share of the residual of known-good runs that must depend on state for a template of it."""
_REGIME_ROWS = 12
"""Rows at which the discrepancy of a regime counts as much as that of the whole output."""


@dataclass(frozen=True)
class Reference:
    """What good runs taught: noise of every output, templates where they hold, the good fit."""

    noise: Mapping[str, OutputNoise]
    templates: Mapping[str, Correction]
    fit: FitResult

    @cached_property
    def left_out(self) -> LeftOut:
        """The good runs, each predicted by the others."""
        return left_out(self.fit)

    @cached_property
    def problem(self) -> Problem:
        """The good runs, weighed by what they taught."""
        ev = self.fit.problem.dataset
        return Problem(ev, Whitening(ev, self.noise), self.expected(ev))

    @cached_property
    def usual(self) -> Usual | None:
        """How the good runs score, each predicted by the others; None of a single run."""
        return usual_of(self.problem, self.left_out.predicted)

    def expected(self, dataset: Dataset) -> Array:
        """The template's part of the residual of other runs, in rows of `dataset`."""
        out = np.zeros(dataset.n)
        for seg in dataset.segments:
            if seg.key in self.templates:
                out[seg.rows] = self.templates[seg.key](dataset, seg.run)
        return out


def fed_noise(
    dataset: Dataset, floors: Mapping[str, Floor], point: ModelPoint, seed: int
) -> dict[str, OutputNoise]:
    """Noise of each output when the model is right: the sensors' own, and what the feeds carry in.

    The plant's own open-loop prediction, with sensor noise and quanta added, is run through the
    views; what is left of it there is the floor of those views.
    """
    noise = {k: _sensor_noise(dataset, floors, k) for k in dataset.keys}
    if all(not v.feeds for v in dataset.views):
        return noise
    rng = np.random.default_rng(seed)
    synthetic = tuple(_synthetic(dataset, r, floors, point, rng) for r in range(len(dataset.runs)))
    other = Dataset(
        dataset.plant,
        synthetic,
        dataset.views,
        dataset.settings,
        dataset.executor,
        fast=dataset.fast,
    )
    residual = other.residual(other.predict([point])[0])
    return {
        key: _with_regimes(other, residual, key, noise[key], inflate=1.0) for key in dataset.keys
    }


def _sensor_noise(dataset: Dataset, floors: Mapping[str, Floor], key: str) -> OutputNoise:
    floor = floors[dataset.rows_of(key)[0].channel]
    return OutputNoise(floor.total, noise_rho=floor.rho)


def _synthetic(
    dataset: Dataset,
    r: int,
    floors: Mapping[str, Floor],
    point: ModelPoint,
    rng: np.random.Generator,
) -> GapRun:
    run, plant = dataset.runs[r], dataset.plant
    views = [v for v in plant.views if v.open_loop]
    predicted = plant.simulate(
        point, run, [v.name for v in views], fast=dataset.detail is not Detail.FINE
    )
    per_bin = max(1.0, dataset.settings.period_s / run.dt_s)
    outputs = {}
    for view in views:
        for out in view.outputs:
            if out.channel not in run.outputs or out.channel not in floors:
                continue
            floor = floors[out.channel]
            channel = next(c for c in plant.channels if c.name == out.channel)
            # White noise averages out over a bin; a bin's worth of it is what the floor measures.
            sd = floor.sigma * np.sqrt(per_bin)
            quantum = channel.quantum
            y = predicted[out.key] + sd * rng.standard_normal(len(run.t_s))
            outputs[out.channel] = np.round(y / quantum) * quantum if quantum > 0 else y
    return replace(run, outputs=outputs)


def _with_regimes(
    dataset: Dataset, residual: Array, key: str, base: OutputNoise, inflate: float
) -> OutputNoise:
    """`base` with the discrepancy that `residual` shows in each regime, in quadrature."""
    rows = np.zeros(dataset.n, dtype=bool)
    for seg in dataset.rows_of(key):
        rows[seg.rows] = True
    rows &= dataset.valid
    square = np.square(residual)
    overall = max(0.0, float(np.mean(square[rows])) - base.sigma**2) if rows.any() else 0.0
    k = {"": float(np.sqrt(inflate * overall + base.k.get("", 0.0) ** 2))}
    free = rows.copy()
    for name, mask in dataset.regime_masks.items():
        here = free & mask
        free &= ~mask
        n = int(here.sum())
        if n == 0:
            continue
        own = max(0.0, float(np.mean(square[here])) - base.sigma**2)
        share = n / (n + _REGIME_ROWS)
        excess = inflate * (share * own + (1 - share) * overall)
        old = base.k.get(name, base.k.get("", 0.0))
        k[name] = float(np.sqrt(excess + old**2))
    return replace(base, k=k, tau_s=correlation_time(dataset, residual, key))


def correlation_time(dataset: Dataset, residual: Array, key: str) -> float:
    """Time in which the autocorrelation of an output's residual falls to 1/e; at most 200 rows.

    The lag-one value is taken as the start, so that white noise on top does not shorten it.
    """
    longest = _LONGEST_LAG
    parts = [residual[seg.rows] for seg in dataset.rows_of(key)]
    total = lagged_products([y - float(np.mean(y)) for y in parts], longest)
    if total[0] <= 0 or total[1] <= 0.05 * total[0]:
        return 0.0
    below = np.flatnonzero(total[1:] < total[1] / np.e)
    return float((below[0] + 1 if len(below) else longest) * dataset.settings.period_s)


def _enlargement(dataset: Dataset, residual: Array, key: str) -> float:
    """How much larger a variance may be than a few runs, or a few slow swings, have shown.

    The second term counts stretches of the correlation time as one observation each.
    """
    rows = sum(s.stop - s.start for s in dataset.rows_of(key))
    tau = correlation_time(dataset, residual, key)
    swings = rows * dataset.settings.period_s / max(2.0 * tau, dataset.settings.period_s)
    return 1.0 + 2.0 / len(dataset.runs) + 8.0 / max(swings, 1.0)


def learn_reference(
    fit: FitResult, base: Mapping[str, OutputNoise], *, templates: bool = True
) -> Reference:
    """Templates and K_δ from the fit of known-good runs.

    Residuals of the fit itself, made larger for having been fitted: those of good runs left out
    would measure how badly few runs fix the parameters, which is not the model's fault.
    """
    problem = fit.problem
    ev = problem.dataset
    residual = ev.residual(fit.predicted)
    found: dict[str, Correction] = {}
    remainder = residual.copy()
    made = Designs.of(ev)
    # What one run has of its own is no background of others.
    for key in ev.keys if templates and len(ev.runs) > 1 else []:
        correction, predicted = fit_correction(made, residual, problem.whitening.s, key)
        if correction.explained >= _TEMPLATE_SHARE:
            found[key] = correction
            remainder -= np.where(ev.valid, predicted, 0.0)
    inflate = {k: _enlargement(ev, remainder, k) for k in ev.keys}
    noise = {k: _with_regimes(ev, remainder, k, base[k], inflate[k]) for k in ev.keys}
    return Reference(noise, found, fit)
