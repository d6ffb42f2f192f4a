"""By how much runs score worse than known-good runs do, each of those predicted by the others.

The score of a cell has its scale marginalised, so that it counts in how many places a model is
off, by what factor, and not how large the few worst places are: n bins whose residual is x times
what it is wont to be cost about n·log x nats. An excess G over the floor is blind to a current that
is off by three floors beside a displacement whose background is ten.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.gap.judge import Judged
from smad.gap.lsq import Problem
from smad.gap.plant import Array

_LEAST_SPREAD = 1.0


@dataclass(frozen=True)
class Usual:
    """Scores of known-good runs, nats a cell.

    `by_output` of each output; `spread` by output is the standard deviation
    from run to run, pooled over the outputs of a view, since a few runs say little of one.
    """

    by_output: Mapping[str, float]
    spread: Mapping[str, float]


@dataclass(frozen=True)
class Deficit:
    """What runs score worse than usual, nats a cell: on all outputs, on each, and on each in a run.

    Runs are named. Outputs that the good runs lack do not count.
    """

    whole: float
    by_output: Mapping[str, float]
    by_run: Mapping[tuple[str, str], float]


def usual_of(good: Problem, predicted: Array) -> Usual | None:
    """What is usual of good runs, of which `predicted` leaves each out; None of a single run."""
    runs = len(good.evidence.runs)
    if runs < 2:
        return None
    scores, keys, run = _cells(good, good.cell_score(good.white(predicted)))
    outputs = list(dict.fromkeys(keys))
    view = {s.key: s.view for s in good.evidence.segments}
    variance: dict[str, list[float]] = {}
    for key in outputs:
        mine = keys == key
        means = [scores[mine & (run == r)].mean() for r in np.unique(run[mine])]
        if len(means) > 1:
            variance.setdefault(view[key], []).append(float(np.var(means, ddof=1)))
    pooled = {v: float(np.sqrt(np.mean(values))) for v, values in variance.items()}
    return Usual(
        {k: float(scores[keys == k].mean()) for k in outputs},
        {k: max(_LEAST_SPREAD, pooled.get(view[k], 0.0)) for k in outputs},
    )


def deficit_of(usual: Usual, judged: Judged) -> Deficit:
    """How much worse than usual a model predicts the runs that it is judged on."""
    parts = [(judged.problem, judged.left_out)]
    if judged.hold is not None:
        parts.append((judged.hold, judged.held))
    cells = [_cells(p, p.cell_score(p.white(predicted))) for p, predicted in parts]
    scores = np.concatenate([c[0] for c in cells])
    keys = np.concatenate([c[1] for c in cells])
    runs = np.concatenate(
        [
            np.array([r.name for r in p.evidence.runs])[c[2]]
            for (p, _), c in zip(parts, cells, strict=True)
        ]
    )
    if not len(scores):
        return Deficit(0.0, {}, {})
    known = [k for k in dict.fromkeys(keys.tolist()) if k in usual.by_output]
    if not known:
        return Deficit(0.0, {}, {})
    seen = np.isin(keys, known)
    expected = np.array([usual.by_output.get(k, 0.0) for k in keys.tolist()])
    pairs = list(dict.fromkeys(zip(keys.tolist(), runs.tolist(), strict=True)))
    return Deficit(
        float((expected - scores)[seen].mean()),
        {k: usual.by_output[k] - float(scores[keys == k].mean()) for k in known},
        {
            (k, r): usual.by_output[k] - float(scores[(keys == k) & (runs == r)].mean())
            for k, r in pairs
            if k in usual.by_output
        },
    )


def clearest(usual: Usual, models: Sequence[Deficit]) -> tuple[str, float]:
    """The output that stands out most whichever of the models is asked, and by how many spreads."""
    least = {k: min(m.by_output[k] for m in models) for k in models[0].by_output}
    away = {k: v / usual.spread[k] for k, v in least.items()}
    output = max(away, key=lambda k: (away[k], k), default="")
    return output, away.get(output, 0.0)


def worst_run(models: Sequence[Deficit]) -> tuple[str, str, float]:
    """Output and run with the largest deficit whichever of the models is asked, and that."""
    least = {k: min(m.by_run[k] for m in models) for k in models[0].by_run}
    output, run = max(least, key=lambda k: (least[k], k), default=("", ""))
    return output, run, least.get((output, run), 0.0)


def _cells(problem: Problem, scores: Array) -> tuple[Array, np.ndarray, np.ndarray]:
    """Score, output and run of every cell that holds anything."""
    ev = problem.evidence
    full = ev.cell_size > 0
    keys = np.array([s.key for s in ev.segments])[ev.cell_segment]
    return scores[full], keys[full], ev.cell_run[full]
