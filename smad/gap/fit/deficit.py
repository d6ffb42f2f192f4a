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


def usual_of(good: Problem, predicted: Array) -> Usual | None:
    """What is usual of good runs, of which `predicted` leaves each out; None of a single run."""
    ev = good.dataset
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


def deficit_of(usual: Usual, judged: Judged) -> dict[str, float]:
    """How much worse than usual a model predicts the runs that it is judged on, nats a cell.

    By output; those that the good runs lack do not count.
    """
    parts = [p.dataset for p in (judged.problem, judged.hold) if p is not None]
    keys = np.concatenate([ev.cell_key for ev in parts])
    full = np.concatenate([ev.cell_size > 0 for ev in parts])
    scores = judged.scores()
    known = [k for k in dict.fromkeys(keys[full].tolist()) if k in usual.by_output]
    return {k: usual.by_output[k] - float(scores[full & (keys == k)].mean()) for k in known}


def clearest(usual: Usual, models: Sequence[Mapping[str, float]]) -> tuple[str, float]:
    """The output that stands out most whichever of the models is asked, and by how many spreads."""
    least = {k: min(m[k] for m in models) for k in models[0]}
    away = {k: v / usual.spread[k] for k, v in least.items()}
    output = max(away, key=lambda k: (away[k], k), default="")
    return output, away.get(output, 0.0)
