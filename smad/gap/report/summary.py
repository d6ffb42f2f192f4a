"""From the working objects of a diagnosis to its records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from smad.gap.compare.localise import HeatMap
from smad.gap.compare.residual_tests import LAGS, cross_correlation, ljung_box
from smad.gap.compare.select import Selection
from smad.gap.fit.hypothesis import Hypothesis
from smad.gap.fit.joint import Interval
from smad.gap.fit.judge import excess_by_key, shrink
from smad.gap.fit.lsq import Problem
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Array, EffectValues, ModelPoint, PlantModel, units
from smad.gap.records import (
    CandidateRecord,
    CellRecord,
    FittedRecord,
    FloorRecord,
    LawRecord,
    ParameterRecord,
    ResidualTest,
    RunRecord,
    Trace,
    ValueRecord,
    WaterfallRow,
)
from smad.gap.runs import GapRun

_MOST_POINTS = 800
_MOST_TRACES = 14
_DOMINANT = 0.1


def run_records(groups: Mapping[str, Sequence[GapRun]]) -> list[RunRecord]:
    """Every run that was given, by role."""
    return [
        RunRecord(run.name, role, run.duration_s, run.digest)
        for role, runs in groups.items()
        for run in runs
    ]


def floor_records(prepared: Prepared) -> list[FloorRecord]:
    """The noise floor of each channel."""
    unit = units(prepared.plant)
    return [
        FloorRecord(f.channel, unit[f.channel], f.sigma, f.rho, f.source)
        for f in prepared.floors.values()
    ]


def waterfall(
    view: str, problem: Problem, predictions: Sequence[Array], plant: PlantModel
) -> list[WaterfallRow]:
    """Rows of one view group: raw, refit, then one prediction for each accepted step."""
    ev = problem.dataset
    gaps = [excess_by_key(problem, np.square(problem.scaled(p))) for p in predictions]
    unit = units(plant)
    rows = []
    for key in ev.keys:
        channel = ev.rows_of(key)[0].channel
        sigma = np.concatenate([problem.whitening.s[s.rows] for s in ev.rows_of(key)])
        floor = float(np.sqrt(np.mean(sigma**2)))
        raw, refit, *effects = (float(np.sqrt(g.get(key, 0.0))) for g in gaps)
        rows.append(WaterfallRow(view, key, channel, unit[channel], floor, raw, refit, effects))
    raw, refit, *effects = (float(np.sqrt(np.mean(list(g.values())))) if g else 0.0 for g in gaps)
    rows.append(WaterfallRow(view, "", "", "", 1.0, raw, refit, effects))
    return rows


def heat_records(raw: HeatMap, refit: HeatMap, final: HeatMap) -> list[CellRecord]:
    """Heat maps before and after, cell by cell."""
    maps = [m.cells for m in (raw, refit, final)]
    return [CellRecord(*place, *(m.get(place, 0.0) for m in maps)) for place in raw.cells]


def candidate_records(
    selection: Selection, probability: Mapping[str, float]
) -> list[CandidateRecord]:
    """Every effect of the library with what screening and fitting said of it.

    `probability` is that of each effect in the first place of the answer.
    """
    # Later fits stand on an effect already named, and say nothing of their own.
    fitted = {c.names[0]: c for c in selection.tried if len(c.names) == 1}
    base = selection.base.judged
    out = []
    for s in selection.screened:
        name, screened = s.effect.name, (s.gain, s.masked, s.size)
        of_fit: tuple[float | None, ...] = ()
        if own := fitted.get(name):
            taken = shrink(own.judged.excess(own.touched), base.excess(own.touched))
            of_fit = (own.gain, own.gain_se, own.regime_gain, taken, probability.get(name))
        out.append(CandidateRecord(name, s.effect.title, s.effect.sub_model, *screened, *of_fit))
    return out


def fitted_records(selection: Selection, answer: Selection) -> list[FittedRecord]:
    """Every model that was fitted jointly, the refit without effects first.

    Of the selection among effects, and of the `answer` where that is a free refit in its place.
    Effects that only the screening saw are not among them: it never fits them to held-out data.
    """
    rivals = [c for several in selection.rivals.values() for c in several]
    everyone = [selection.base, *selection.tried, *rivals, *selection.steps, selection.best]
    known = {tuple(sorted(c.names)): c for c in everyone}
    free = [] if answer is selection else [answer.base]
    return [_fitted_record(c) for c in (*known.values(), *free)]


def _fitted_record(c: Hypothesis) -> FittedRecord:
    fit, judged = c.fit, c.judged
    valid, held = fit.problem.dataset.valid, judged.bench.dataset.valid
    return FittedRecord(
        names=list(c.names),
        parameters=fit.space.size,
        rows=int(np.sum(valid)),
        objective=float(fit.objective),
        chi2=float(np.sum(np.square(fit.z[valid]))),
        held_out=float(np.sqrt(np.mean(judged.squares()[held]))),
        gap=judged.excess(),
        score=float(np.sum(judged.scores())),
    )


def value_records(found: Sequence[Interval], before: EffectValues) -> list[ValueRecord]:
    """Intervals of the effects' parameters, and what they were in the known-good runs."""
    return [
        ValueRecord(
            before=before.get(v.effect, {}).get(v.name, 0.0),
            **{**vars(v), "profile": list(v.profile)},
        )
        for v in found
    ]


def parameter_records(prepared: Prepared, best: Hypothesis, draws: Array) -> list[ParameterRecord]:
    """Model parameters before, after the refit and with the effects, with intervals by `draws`."""
    fit, refit = best.fit, prepared.fit
    coordinates = (fit.p, *np.quantile(draws, (0.025, 0.975), axis=0))
    out = []
    for i, q in enumerate(fit.space.theta):
        before = prepared.centre.get(q.name, q.nominal)
        refitted = refit.space.value(i, float(refit.p[i]))
        final, low, high = (fit.space.value(i, float(p[i])) for p in coordinates)
        values = (before, refitted, final, low, high)
        out.append(ParameterRecord(q.name, q.unit, *values, fit.at_bound[i]))
    return out


def covariance_record(best: Hypothesis, model: ModelPoint, draws: Array) -> dict[str, Any]:
    """Covariance of the values that `model` has over `draws` of the best fit, in their own units.

    Parameters by name, those of effects as EFFECT.PARAMETER: see `smad.gap.plant.Uncertainty`.
    """
    space = best.fit.space
    names = [q.name for q in space.theta]
    names += [f"{e.name}.{q.name}" for e in space.effects for q in e.parameters]
    scale = np.array([space.value(i, 1.0) - space.value(i, 0.0) for i in range(space.size)])
    matrix = np.atleast_2d(np.cov(draws, rowvar=False)) * np.outer(scale, scale)
    known = [
        i for i, name in enumerate(names)
        if i < space.n_theta or name.partition(".")[0] in model.effects
    ]  # fmt: skip
    return {
        "names": [names[i] for i in known], "matrix": matrix[np.ix_(known, known)].tolist(),
    }  # fmt: skip


def law_records(prepared: Prepared, best: Hypothesis) -> list[LawRecord]:
    """What known-good runs gave the model besides parameters; effects that are named are not it."""
    now = best.fit.point.effects
    return [
        LawRecord(e.name, q.name, q.unit, prepared.fixed[e.name][q.name], now[e.name][q.name])
        for e in prepared.plant.effects
        if e.name in prepared.fixed and e.name not in best.names
        for q in e.parameters
    ]


def residual_test_records(prepared: Prepared, best: Hypothesis) -> list[ResidualTest]:
    """Ljung–Box of each output, and its strongest correlation with an input or a state."""
    ev = prepared.problem.dataset
    out = []
    for key in ev.keys:
        segments = ev.rows_of(key)
        longest = max(segments, key=lambda s: (s.stop - s.start, -s.run))
        rows = best.fit.z[longest.rows]
        out.append(ResidualTest(key, f"Ljung–Box, {LAGS} lags", *ljung_box(rows)))
        run, grid = ev.runs[longest.run], ev.grids[longest.run]
        drivers = {n: grid.mean(v) for n, v in run.inputs.items()}
        drivers |= {f"{n}²": v**2 for n, v in drivers.items()}
        features = prepared.plant.features(run, longest.side)
        drivers |= {n: grid.mean(np.nan_to_num(v)) for n, v in features.items()}
        found = {n: cross_correlation(driver, rows) for n, driver in drivers.items()}
        name, (r, p) = min(found.items(), key=lambda item: item[1][1])
        if p < 1.0:
            out.append(ResidualTest(key, f"correlation with {name}", r, p))
    return out


def traces(
    view: str, problem: Problem, refit: Array, final: Array, plant: PlantModel
) -> list[Trace]:
    """Measured, refitted and final course of the outputs of the judging runs, decimated."""
    ev, unit = problem.dataset, units(plant)
    gap = excess_by_key(problem, np.square(problem.scaled(refit)))
    order = sorted(ev.segments, key=lambda s: (-gap.get(s.key, 0.0), s.key, s.run))
    shown = (ev.measured, refit + problem.background, final + problem.background)
    out = []
    for s in order[:_MOST_TRACES]:
        step = max(1, -(-(s.stop - s.start) // _MOST_POINTS))
        cut = slice(s.start, s.stop, step)
        t_s = np.round(ev.t_s[cut], 3).tolist()
        courses = ([float(f"{v:.6g}") for v in values[cut]] for values in shown)
        name, channel = ev.runs[s.run].name, s.channel
        out.append(Trace(name, view, s.key, channel, unit[channel], t_s, *courses))
    return out


def dominant_outputs(gaps: Mapping[str, float]) -> list[str]:
    """Outputs with at least a tenth of the total excess power, largest first."""
    total = sum(gaps.values())
    chosen = [k for k, v in gaps.items() if total > 0 and v >= _DOMINANT * total]
    return sorted(chosen, key=lambda k: (-gaps[k], k))
