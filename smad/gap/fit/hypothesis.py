"""A hypothesis: a set of effects, fitted and judged, and what its last one must show to enter."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from smad.gap.data.replay import Index
from smad.gap.fit.doubt import Doubt
from smad.gap.fit.joint import JointFit
from smad.gap.fit.judge import Judged
from smad.gap.fit.lsq import FitResult, Problem
from smad.gap.fit.resample import block_of
from smad.gap.plant import Array
from smad.gap.settings import Settings

_TOUCHED_SHARE = 0.1
"""Share of what a cause changes that an output must carry to count as its own."""


@dataclass(frozen=True)
class Hypothesis:
    """A model of the selection: a set of effects, fitted and judged.

    `gain` is the rise of the held-out log-likelihood over the model it was added to, as far as that
    model's own causes are to be believed (`doubt`), `gain_se` its standard error over runs and
    blocks, `touched` the outputs that carry the effect's signature, `excess_before` the gap over
    them without it, `regime_gain` the sum of gains on regimes left out, `cells` the number of cells
    judged.
    """

    joint: JointFit
    judged: Judged
    gain: float = 0.0
    gain_se: float = 0.0
    touched: tuple[str, ...] = ()
    excess_before: float = 0.0
    regime_gain: float = 0.0
    cells: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        return self.joint.names

    @property
    def fit(self) -> FitResult:
        return self.joint.fit

    @cached_property
    def score(self) -> float:
        """Log-likelihood of everything that it is judged on."""
        return float(self.judged.scores().sum())

    @cached_property
    def doubt(self) -> Doubt:
        """What its own causes leave uncertain."""
        return Doubt.about(self.fit, self.judged)


def differing(model: Hypothesis, other: Hypothesis) -> str:
    """The effect of `other` that `model` lacks."""
    extra = [n for n in other.names if n not in model.names]
    return extra[0] if extra else ""


def cluster_gain(problem: Problem, hold: Problem | None, gain: Array) -> tuple[float, float]:
    """Sum of a cell-wise gain and its standard error over blocks of time."""
    sums = block_sums(problem, hold, gain)
    total = float(sums.sum())
    return total, float(np.std(sums) * np.sqrt(len(sums)))


def block_sums(problem: Problem, hold: Problem | None, values: Array) -> Array:
    """Sums of what `Judged.scores` would list, over the cells of each block of time of each run."""
    block = block_of(*held_cells(problem, hold))
    return np.asarray(np.bincount(block, weights=values), dtype=np.float64)


def held_cells(problem: Problem, hold: Problem | None) -> tuple[Index, Index]:
    """Run and block of every cell that `Judged.scores` lists."""
    a = problem.dataset
    if hold is None:
        return a.cell_run, a.cell_block
    b = hold.dataset
    return np.r_[a.cell_run, b.cell_run + len(a.runs)], np.r_[a.cell_block, b.cell_block]


def ending_at_bound(fit: FitResult) -> list[str]:
    """Effects whose strength ends at the upper bound of its range, or lower, if that is not 0.

    A share of 1 is no bound of a range: there is no more than all.
    """
    flat = [(e, q) for e in fit.space.effects for q in e.parameters]
    found = []
    for i, (effect, q) in enumerate(flat, fit.space.n_theta):
        all_of_it = q.unit == "1" and q.high == 1.0 and fit.space.value(i, fit.p[i]) > 0.5
        if q.strength and fit.at_bound[i] and not all_of_it:
            found.append(effect.name)
    return list(dict.fromkeys(found))


def touched_outputs(before: Judged, after: Judged) -> tuple[str, ...]:
    """Outputs that carry a good part of what an effect changes, in floors."""
    ev = after.bench.dataset
    change = np.square(after.bench.whitening.scale(after.predicted - before.predicted))
    power = {k: float(sum(change[s.rows].sum() for s in ev.rows_of(k))) for k in ev.keys}
    total = sum(power.values())
    return tuple(k for k, v in power.items() if total > 0 and v >= _TOUCHED_SHARE * total)


def asked_gain(c: Hypothesis, s: Settings, *, tied: bool) -> float:
    """What the held-out gain of a candidate must exceed, nats.

    Beside tied parameters every effect gains something where the bench's laws have another form
    than the model's, in proportion to the cells judged.
    """
    clear = s.standard_errors * c.gain_se
    return max(clear, s.since_gain * c.cells) if tied else clear


def acceptable(c: Hypothesis, s: Settings, *, tied: bool) -> bool:
    """Whether the last effect of a candidate may enter, beside tied parameters or free ones.

    What it gains must not be lost where a regime is left out. Beside tied parameters it stands out
    by its score although the background is larger; beside free ones there must be a gap.
    """
    stands = c.gain > asked_gain(c, s, tied=tied) and c.gain + c.regime_gain > 0.0
    return stands and (tied or c.excess_before >= s.min_excess)
