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

from smad.gap.fit.judge import Judged
from smad.gap.fit.lsq import Problem
from smad.gap.plant import Array

_LEAST_SPREAD = 1.0
"""Nats a cell that known-good runs are taken to differ by at least."""


@dataclass(frozen=True)
class Usual:
    """Scores of known-good runs, nats a cell.

    `by_output` of each output; `spread` by output is the standard deviation from run to run, pooled
    over the outputs of a view, since a few runs say little of one.
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
    ev = good.evidence
    if len(ev.runs) < 2:
        return None
    full = ev.cell_size > 0
    scores = good.cell_score(good.white(predicted))[full]
    keys, run = ev.cell_key[full], ev.cell_run[full]
    view = {s.key: s.view for s in ev.segments}
    outputs = list(dict.fromkeys(keys.tolist()))
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
    parts = [p.evidence for p in (judged.problem, judged.hold) if p is not None]
    keys = np.concatenate([ev.cell_key for ev in parts])
    runs = np.concatenate([np.array([r.name for r in ev.runs])[ev.cell_run] for ev in parts])
    full = np.concatenate([ev.cell_size > 0 for ev in parts])
    counts = full & np.isin(keys, list(usual.by_output))
    if not counts.any():
        return Deficit(0.0, {}, {})
    keys, runs = keys[counts], runs[counts]
    worse = np.array([usual.by_output[k] for k in keys.tolist()]) - judged.scores()[counts]
    pairs = dict.fromkeys(zip(keys.tolist(), runs.tolist(), strict=True))
    return Deficit(
        float(worse.mean()),
        {k: float(worse[keys == k].mean()) for k in dict.fromkeys(keys.tolist())},
        {(k, r): float(worse[(keys == k) & (runs == r)].mean()) for k, r in pairs},
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
