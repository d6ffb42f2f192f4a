"""Where the gap goes: raw, parameters, each cause in turn, rest; on the runs that were judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from smad.gap.data.replay import Detail
from smad.gap.fit.hypothesis import Hypothesis, cluster_gain
from smad.gap.fit.judge import Judged, excess_of
from smad.gap.fit.lsq import Problem
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Array, ModelPoint
from smad.gap.records import Budget, BudgetRow, RunGap, WaterfallRow
from smad.gap.report.summary import waterfall

_DOMINATING_SHARE = 0.5
"""Of the excess power, from which one run is said to dominate."""


@dataclass(frozen=True)
class Way:
    """The models from the raw one to the last, and what each predicts of the judged runs.

    `predictions` are of the model as configured, after the parameters, and after each of `causes`.
    `parameters`: whether the values of the parameters that the refit found are part of the models.
    """

    causes: tuple[str, ...]
    parameters: bool
    predictions: Sequence[Array]


def way(prepared: Prepared, chain: Sequence[Hypothesis], refit: Judged) -> Way:
    """The way to the last of `chain`, without other values of the parameters where none is needed.

    They are not where the effects of the last model, at the parameters as they were, predict runs
    that were not fitted to as well, or leave no gap that is significant.
    """
    causes = _in_order(chain)
    if not causes:
        return Way((), True, [prepared.raw.predicted, refit.predicted])
    last, centre = chain[-1], prepared.centre
    points = [point_with(prepared, centre, last, causes[: i + 1]) for i in range(len(causes))]
    problem, hold = prepared.problem, prepared.hold
    own = problem.dataset.predict(points, detail=Detail.FINE)
    held = own[:, :0] if hold is None else hold.dataset.predict(points, detail=Detail.FINE)
    plain = Judged(problem, hold, own[-1], held[-1])
    gain, error = cluster_gain(problem, hold, last.judged.scores() - plain.scores())
    clear = prepared.settings.standard_errors * error
    if gain > clear and plain.excess() > prepared.threshold:
        steps = _one_by_one(prepared, chain, causes)
        return Way(causes, True, [prepared.raw.predicted, refit.predicted, *steps])
    steps = list(own if hold is None else held)
    return Way(causes, False, [prepared.raw.predicted, prepared.raw.predicted, *steps])


def _one_by_one(
    prepared: Prepared, chain: Sequence[Hypothesis], causes: Sequence[str]
) -> list[Array]:
    """A prediction for each cause. Those that entered together are put in one after the other."""
    judged_on = prepared.problem if prepared.hold is None else prepared.hold
    steps: list[Array] = []
    told: list[str] = []
    for c in chain:
        entered = [name for name in causes if name in c.names and name not in told]
        for name in entered[:-1]:
            told.append(name)
            point = point_with(prepared, c.fit.point.theta, c, told)
            steps.append(judged_on.dataset.predict([point], detail=Detail.FINE)[0])
        if entered:
            told.append(entered[-1])
            steps.append(c.judged.predicted)
    return steps


def _in_order(chain: Sequence[Hypothesis]) -> tuple[str, ...]:
    """The effects of the last model, in the order in which the chain took them in."""
    last = chain[-1].names if chain else ()
    return tuple(dict.fromkeys(name for c in chain for name in c.names if name in last))


def point_with(
    prepared: Prepared, theta: Mapping[str, float], c: Hypothesis, names: Sequence[str]
) -> ModelPoint:
    """Parameters `theta`, what known-good runs ask for, and of the effects of `c` only `names`."""
    own = {k: dict(v) for k, v in c.fit.point.effects.items() if k in names}
    return ModelPoint(theta, {**prepared.fixed, **own})


def budget_of(prepared: Prepared, way: Way, refit: Judged, *, named: bool) -> Budget:
    """The budget on the judged runs, by signal, in all, and by run."""
    bench = refit.bench
    rows = waterfall("local", bench, way.predictions, prepared.plant)
    raw = rows[-1].raw
    alone = 1.0 - refit.excess() / raw if raw > 0.0 else 0.0
    runs = _by_run(bench, way.predictions)
    carried = np.array([r.refit**2 for r in runs])
    share = float(carried.max() / carried.sum()) if carried.sum() > 0.0 else 0.0
    # Of two runs one always has half.
    dominates = len(runs) > 1 and share > max(_DOMINATING_SHARE, 1.8 / len(runs))
    return Budget(
        causes=list(way.causes),
        named=named,
        parameters=way.parameters,
        alone=alone,
        rows=[_row(r) for r in (rows[-1], *rows[:-1])],
        runs=runs,
        median=_median(runs),
        dominated_by=runs[int(carried.argmax())].run if dominates else "",
        dominating=share if dominates else 0.0,
    )


def _row(r: WaterfallRow) -> BudgetRow:
    # The last step, to no gap at all, is the rest.
    gaps = [r.raw, r.refit, *r.effects, 0.0]
    parameters, *causes, rest = ((a - b) / r.raw if r.raw > 0.0 else 0.0 for a, b in pairwise(gaps))
    return BudgetRow(r.output, r.floor, r.unit, r.raw, parameters, causes, rest, gaps[-2])


def _by_run(problem: Problem, predictions: Sequence[Array]) -> list[RunGap]:
    ev = problem.dataset
    squares = [np.square(problem.scaled(p)) for p in (*predictions[:2], predictions[-1])]
    out = []
    for k, run in enumerate(ev.runs):
        rows = (ev.cell_run[ev.row_cell] == k).astype(float)
        out.append(RunGap(run.name, *(excess_of(problem, q, None, rows) for q in squares)))
    return out


def _median(runs: Sequence[RunGap]) -> RunGap | None:
    if len(runs) < 2:
        return None
    gaps = np.median([(r.raw, r.refit, r.final) for r in runs], axis=0)
    return RunGap("median", *gaps.tolist())
