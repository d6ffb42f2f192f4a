"""Stages 1 to 4 put together: from admitted runs to a refitted model with its weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.gap.data.noise import Floor, estimate_floors
from smad.gap.data.replay import Dataset, Detail, Segment
from smad.gap.data.views import local_views, open_views, shared_views
from smad.gap.errors import RunRefused
from smad.gap.fit.baseline import as_fixed, learn_baseline, unbound, with_laws
from smad.gap.fit.coarse import serving_replays
from smad.gap.fit.discrepancy import Reference, fed_noise, learn_reference
from smad.gap.fit.judge import Judged, excess_of, judge, predict_by_run
from smad.gap.fit.lsq import FitResult, Problem, fitted
from smad.gap.fit.refit import REFIT_ITERATIONS, refit
from smad.gap.fit.threads import repeatable
from smad.gap.model.whiten import OutputNoise, Whitening
from smad.gap.plant import Array, EffectValues, ModelPoint, PlantModel, View, nominal_point
from smad.gap.runs import GapRun
from smad.gap.settings import Settings

_TOLD_ROWS = 400
_DAY_SHARE = 0.01
"""How far a parameter may move from one day to the next without counting as a change, in standard
deviations of its prior."""


@dataclass(frozen=True)
class Prepared:
    """Everything the selection needs.

    `centre` are the parameter values the question starts from: the nominal ones, or those of the
    known-good runs; `fixed` the effects that those ask for already. `fit` is the refit with every
    parameter free, `tied` the one with the parameters as well known as the good runs make them
    (only with good runs). `threshold` is the gap over the floor that counts as significant.
    """

    plant: PlantModel
    settings: Settings
    floors: Mapping[str, Floor]
    noise: Mapping[str, OutputNoise]
    problem: Problem
    hold: Problem | None
    fit: FitResult
    tied: FitResult | None
    free: Judged
    raw: Judged
    reference: Reference | None
    centre: Mapping[str, float]
    fixed: EffectValues
    threshold: float

    @cached_property
    def gentle(self) -> Judged:
        """The free refit by plain least squares, judged."""
        return judge([_plain(self.fit)], self.hold)[0]

    @cached_property
    def outputs(self) -> dict[str, Segment]:
        """Every output of the runs to fit on or held out, as a segment that has it."""
        held = () if self.hold is None else self.hold.dataset.segments
        return {s.key: s for s in (*held, *self.problem.dataset.segments)}


def prepare(
    runs: Sequence[GapRun],
    plant: PlantModel,
    settings: Settings,
    *,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Prepared:
    """Noise floor, background from good runs, refit, and the held-out judgement of the refit."""
    views = shared_views(local_views(plant), (runs, hold_out, good))
    if not views:
        raise RunRefused(
            "the runs share no output",
            value="no view of the plant is fed and measured in runs to fit, held out and good ones",
            action="give runs in which the same channels were recorded",
        )
    progress("noise floor")
    floors = estimate_floors([*runs, *hold_out, *good], plant, settings)
    first = _beginning(runs[0], settings)
    fast = serving_replays(
        lambda fast: Dataset(plant, [first], views, settings, executor, fast=fast), floors
    )
    if fast != 1:
        progress("replaying in shorter steps")

    def dataset(chosen: Sequence[GapRun]) -> Dataset:
        return Dataset(plant, chosen, views, settings, executor, fast=fast)

    reference = None
    if good:
        progress(f"fitting {len(good)} known-good runs")
        reference = _reference_of(dataset(good), floors, progress)
    lost = sorted(_keys(local_views(plant)) - _keys(views))
    ev = Dataset(plant, runs, views, settings, executor, fast=fast, not_shared=lost)
    hold = dataset(hold_out) if hold_out else None
    refitting = f"refitting {len(plant.parameters)} parameters"
    if reference is None:
        noise = fed_noise(ev, floors, nominal_point(plant), settings.seed)
        progress(refitting)
        stood = _from_nominal(ev, hold, noise)
    else:
        noise = dict(reference.noise)
        progress(refitting)
        stood = _from_good(ev, hold, reference)
    start = stood.start
    problem, held = stood.problem, stood.hold
    raw = Judged(
        problem,
        held,
        ev.predict([start], detail=Detail.FINE)[0],
        np.zeros(0) if hold is None else hold.predict([start], detail=Detail.FINE)[0],
    )
    return Prepared(
        plant,
        settings,
        floors,
        noise,
        problem,
        held,
        stood.fit,
        stood.tied,
        stood.free,
        raw,
        reference,
        start.theta,
        start.effects,
        _threshold(reference, settings),
    )


@dataclass(frozen=True)
class _Refitted:
    """The refit of the model at `start`, in the names of `Prepared`."""

    start: ModelPoint
    problem: Problem
    hold: Problem | None
    fit: FitResult
    tied: FitResult | None
    free: Judged


def _from_nominal(ev: Dataset, hold: Dataset | None, noise: Mapping[str, OutputNoise]) -> _Refitted:
    """The refit of the nominal model, every parameter free."""
    problem = _weighed(ev, noise, None)
    held = None if hold is None else _weighed(hold, noise, None)
    start = nominal_point(ev.plant)
    fit = refit(problem, ev.plant.parameters, start.theta)
    return _Refitted(start, fit.problem, held, fit, None, judge([fit], held)[0])


def _from_good(ev: Dataset, hold: Dataset | None, reference: Reference) -> _Refitted:
    """The refits of the model of the good runs: parameters tied to it, and free."""
    problem = _weighed(ev, reference.noise, reference)
    held = None if hold is None else _weighed(hold, reference.noise, reference)
    start = reference.fit.point
    tie = _tie(reference)
    tied = refit(problem, ev.plant.parameters, start.theta, start.effects, tie=tie)
    fit = unbound(tied)
    free = judge([fit], held)[0]
    tied = tied.recalibrated()
    return _Refitted(start, tied.problem, held, as_fixed(fit), tied, free)


def _weighed(ev: Dataset, noise: Mapping[str, OutputNoise], reference: Reference | None) -> Problem:
    """Evidence with its weights, and what good runs expect of it."""
    own = {k: noise[k] for k in ev.keys}
    expected = np.zeros(ev.n) if reference is None else reference.expected(ev)
    return Problem(ev, Whitening(ev, own), expected)


@repeatable
def known_good(
    runs: Sequence[GapRun], plant: PlantModel, settings: Settings, executor: Executor | None = None
) -> Reference:
    """What the model makes of known-good runs alone: baseline, K_δ and the fit itself."""
    ev = Dataset(plant, runs, local_views(plant), settings, executor)
    floors = estimate_floors(runs, plant, settings)
    return _reference_of(ev, floors, lambda text: None)


def _beginning(run: GapRun, settings: Settings) -> GapRun:
    """As much of a run as tells whether coarser replays serve."""
    return run.part(0, int(np.searchsorted(run.t_s - run.t_s[0], _TOLD_ROWS * settings.period_s)))


def _keys(views: Sequence[View]) -> set[str]:
    return {o.key for v in views for o in v.outputs}


def _reference_of(
    ev: Dataset,
    floors: Mapping[str, Floor],
    progress: Callable[[str], None],
) -> Reference:
    """Baseline and K_δ of known-good runs.

    First by least squares, which shares the misfit out; its size by output and regime is then the
    weight with which the baseline is sought and the fit repeated.
    """
    base = fed_noise(ev, floors, nominal_point(ev.plant), ev.settings.seed)
    parameters, effects = ev.plant.parameters, ev.plant.effects
    plain = Problem(ev, Whitening(ev, base), np.zeros(ev.n))
    rough = with_laws(plain, parameters, effects)
    noise = learn_reference(rough, base, templates=False).noise
    weighed = replace(rough.problem, whitening=Whitening(ev, noise))
    fit = fitted(
        weighed,
        rough.space,
        rough.p,
        iterations=REFIT_ITERATIONS,
        refresh_theta=True,
        rough=True,
    )
    fit = learn_baseline(fit, effects, progress)
    return learn_reference(fit, base)


def _tie(reference: Reference) -> Array:
    """Precision of the parameters after the good runs, loosened by what a day changes.

    The good runs count as fully as the runs under test do: a fit with this tie is the fit of both
    together, the effects acting on the latter only. Shape (parameters, parameters).
    """
    fit = reference.fit
    H, _ = fit.normal_equations()
    known = np.linalg.inv(H.sum(axis=0) + np.eye(fit.space.n_theta))
    return np.asarray(np.linalg.inv(known + np.eye(len(known)) * _DAY_SHARE**2))


def _plain(fit: FitResult) -> FitResult:
    """The refit by plain least squares, every cell at its full weight."""
    problem = _Plain(fit.problem.dataset, fit.problem.whitening, fit.problem.background)
    end = fitted(problem, fit.space, fit.p, theta_A=fit.A, iterations=3)
    return FitResult(
        fit.problem,
        end.space,
        end.p,
        end.predicted,
        end.z,
        end.A,
        end.objective,
        end.at_bound,
    )


class _Plain(Problem):
    """Ordinary least squares: the scale of every cell is known to be the floor."""

    def cell_score(self, z: Array, heat: float = 1.0) -> Array:
        return -0.5 * self.cell_q(z) / heat**2

    def cell_weight(self, z: Array, heat: float = 1.0) -> Array:
        return np.asarray((self.dataset.cell_size > 0) / heat**2)


def _threshold(reference: Reference | None, settings: Settings) -> float:
    """Gap over the floor beyond which a refitted gap is significant.

    Good runs show how much a run without any trouble exceeds the floor that all of them set.
    """
    if reference is None:
        return settings.min_excess
    own = reference.problem
    ev = own.dataset
    squares = np.square(own.scaled(reference.left_out.predicted))
    per_run = []
    for r in range(len(ev.runs)):
        weight = np.zeros(ev.n)
        for s in ev.segments:
            if s.run == r:
                weight[s.rows] = 1.0
        per_run.append(excess_of(own, squares, None, weight))
    # The mean of several runs varies less than one run does.
    return max(settings.min_excess, 1.1 * max(per_run) * float(np.sqrt(2.0 / len(per_run))))


def open_loop(prepared: Prepared, executor: Executor | None = None) -> Problem:
    """The whole simulator on the judging runs, with the floor that good runs give each output."""
    plant, settings = prepared.plant, prepared.settings
    bench = prepared.problem if prepared.hold is None else prepared.hold
    runs = bench.dataset.runs
    known = prepared.reference
    good_runs = () if known is None else known.fit.problem.dataset.runs
    views = shared_views(open_views(plant), (runs, good_runs))
    ev = Dataset(plant, runs, views, settings, executor, fast=0)
    noise = {k: OutputNoise(prepared.floors[ev.rows_of(k)[0].channel].total) for k in ev.keys}
    if known is not None:
        good = Dataset(plant, good_runs, views, settings, executor, fast=0)
        problem = Problem(good, Whitening(good, noise), np.zeros(good.n))
        residual = good.residual(predict_by_run(problem, known.left_out.points, known.fit.point))
        for key in list(noise):
            rows = good.valid_rows(key, residual)
            power = float(np.mean(np.square(rows))) if len(rows) else 0.0
            noise[key] = OutputNoise(max(noise[key].sigma, float(np.sqrt(power))))
    return Problem(ev, Whitening(ev, noise), np.zeros(ev.n))
