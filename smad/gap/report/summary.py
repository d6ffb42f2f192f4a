"""From the working objects of a diagnosis to its records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from smad.gap.compare.localise import HeatMap
from smad.gap.compare.residual_tests import LAGS, cross_correlation, ljung_box
from smad.gap.compare.select import Selection
from smad.gap.data.replay import Evidence
from smad.gap.fit.candidate import Candidate
from smad.gap.fit.joint import Interval
from smad.gap.fit.judge import excess_by_key, shrink
from smad.gap.fit.lsq import Problem
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Array, EffectValues, PlantModel, units
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
    ev = problem.evidence
    gaps = [excess_by_key(problem, np.square(problem.scaled(p))) for p in predictions]
    unit = units(plant)
    rows = []
    for key in ev.keys:
        first = ev.rows_of(key)[0]
        valid = np.concatenate([problem.whitening.s[s.rows] for s in ev.rows_of(key)])
        values = [float(np.sqrt(g.get(key, 0.0))) for g in gaps]
        rows.append(
            WaterfallRow(
                view,
                key,
                first.channel,
                unit[first.channel],
                float(np.sqrt(np.mean(valid**2))),
                values[0],
                values[1],
                values[2:],
            )
        )
    total = [float(np.sqrt(np.mean(list(g.values())))) if g else 0.0 for g in gaps]
    rows.append(WaterfallRow(view, "", "", "", 1.0, total[0], total[1], total[2:]))
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
    fitted: dict[str, Candidate] = {}
    # Later fits stand on an effect already named, and say nothing of their own.
    for c in selection.tried:
        if len(c.names) == 1:
            fitted[c.names[0]] = c
    base = selection.base.judged
    out = []
    for s in selection.screened:
        effect, own = s.effect, fitted.get(s.effect.name)
        record = CandidateRecord(
            effect.name, effect.title, effect.sub_model, s.gain, s.masked, s.size
        )
        if own is not None:
            record = msgspec.structs.replace(
                record,
                gain=own.gain,
                gain_se=own.gain_se,
                regime_gain=own.regime_gain,
                shrink=shrink(own.judged.excess(own.touched), base.excess(own.touched)),
                probability=probability.get(effect.name),
            )
        out.append(record)
    return out


def fitted_records(selection: Selection, answer: Selection) -> list[FittedRecord]:
    """Every model that was fitted jointly, the refit without effects first.

    Of the selection among effects, and of the `answer` where that is a free refit in its place.
    Effects that only the screening saw are not among them: it never fits them to held-out data.
    """
    known: dict[tuple[str, ...], Candidate] = {}
    everyone = [selection.base, *selection.tried]
    everyone += [c for rivals in selection.rivals.values() for c in rivals]
    for c in [*everyone, *selection.steps, selection.best]:
        known[tuple(sorted(c.names))] = c
    free = [] if answer is selection else [answer.base]
    return [_fitted_record(c) for c in (*known.values(), *free)]


def _fitted_record(c: Candidate) -> FittedRecord:
    fit, judged = c.fit, c.judged
    valid, held = fit.problem.evidence.valid, judged.bench.evidence.valid
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
            v.effect,
            v.name,
            v.unit,
            v.value,
            before.get(v.effect, {}).get(v.name, 0.0),
            v.low,
            v.high,
            v.at_bound,
            v.identifiable,
            list(v.profile),
        )
        for v in found
    ]


def parameter_records(prepared: Prepared, best: Candidate, draws: Array) -> list[ParameterRecord]:
    """Model parameters before, after the refit and with the effects, with bootstrap intervals."""
    fit = best.fit
    low, high = np.quantile(draws, (0.025, 0.975), axis=0)
    out = []
    for i, q in enumerate(fit.space.theta):
        out.append(
            ParameterRecord(
                q.name,
                q.unit,
                prepared.centre.get(q.name, q.nominal),
                prepared.fit.space.value(i, float(prepared.fit.p[i])),
                fit.space.value(i, float(fit.p[i])),
                fit.space.value(i, float(low[i])),
                fit.space.value(i, float(high[i])),
                fit.at_bound[i],
            )
        )
    return out


def law_records(prepared: Prepared, best: Candidate) -> list[LawRecord]:
    """What known-good runs gave the model besides parameters; effects that are named are not it."""
    now = best.fit.point.effects
    return [
        LawRecord(e.name, q.name, q.unit, prepared.fixed[e.name][q.name], now[e.name][q.name])
        for e in prepared.plant.effects
        if e.name in prepared.fixed and e.name not in best.names
        for q in e.parameters
    ]


def residual_test_records(prepared: Prepared, best: Candidate) -> list[ResidualTest]:
    """Ljung–Box of each output, and its strongest correlation with an input or a state."""
    problem = prepared.problem
    ev = problem.evidence
    z = best.fit.z
    out = []
    for key in ev.keys:
        segments = ev.rows_of(key)
        longest = max(segments, key=lambda s: (s.stop - s.start, -s.run))
        rows = z[longest.rows]
        q, p = ljung_box(rows)
        out.append(ResidualTest(key, f"Ljung–Box, {LAGS} lags", q, p))
        run, grid = ev.runs[longest.run], ev.grids[longest.run]
        drivers = {n: grid.mean(v) for n, v in run.inputs.items()}
        drivers |= {f"{n}²": v**2 for n, v in drivers.items()}
        features = prepared.plant.features(run, longest.side)
        drivers |= {n: grid.mean(np.nan_to_num(v)) for n, v in features.items()}
        worst = ("", 0.0, 1.0)
        for name, driver in drivers.items():
            r, pr = cross_correlation(driver, rows)
            if pr < worst[2]:
                worst = (name, r, pr)
        if worst[0]:
            out.append(ResidualTest(key, f"correlation with {worst[0]}", worst[1], worst[2]))
    return out


def traces(
    view: str, problem: Problem, refit: Array, final: Array, plant: PlantModel
) -> list[Trace]:
    """Measured, refitted and final course of the outputs of the judging runs, decimated."""
    ev: Evidence = problem.evidence
    unit = units(plant)
    gap = excess_by_key(problem, np.square(problem.scaled(refit)))
    order = sorted(ev.segments, key=lambda s: (-gap.get(s.key, 0.0), s.key, s.run))
    out = []
    for s in order[:_MOST_TRACES]:
        step = max(1, -(-(s.stop - s.start) // _MOST_POINTS))
        cut = slice(s.start, s.stop, step)
        background = problem.background[cut]
        out.append(
            Trace(
                ev.runs[s.run].name,
                view,
                s.key,
                s.channel,
                unit[s.channel],
                np.round(ev.t_s[cut], 3).tolist(),
                _shortened(ev.measured[cut]),
                _shortened(refit[cut] + background),
                _shortened(final[cut] + background),
            )
        )
    return out


def _shortened(values: Array) -> list[float]:
    return [float(f"{v:.6g}") for v in values]


def dominant_outputs(gaps: Mapping[str, float]) -> list[str]:
    """Outputs with at least a tenth of the total excess power, largest first."""
    total = sum(gaps.values())
    chosen = [k for k, v in gaps.items() if total > 0 and v >= _DOMINANT * total]
    return sorted(chosen, key=lambda k: (-gaps[k], k))
