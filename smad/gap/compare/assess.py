"""What a selection is worth: shrink with its interval, ceiling, and what it cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.gap.compare.select import Selection
from smad.gap.fit.hypothesis import Hypothesis, block_sums
from smad.gap.fit.joint import dispersion
from smad.gap.fit.judge import Judged, excess_of, shrink
from smad.gap.fit.lsq import Problem
from smad.gap.fit.resample import DRAWS, resample_weights
from smad.gap.model.flexible import Designs, fit_correction
from smad.gap.plant import Array


@dataclass(frozen=True)
class Worth:
    """Gaps and shrinks on held-out runs, over `keys`.

    `ceiling` is the shrink that a flexible correction reaches, alone or on top of the best model.
    `draws` are bootstrap values of (S, ceiling), shape (draws, 2); `score_share` those of the part
    of a flexible correction's gain in log-likelihood that the best model reaches, shape (draws,).
    """

    keys: tuple[str, ...]
    gap_refit: float
    gap_final: float
    shrink: float
    ceiling: float
    draws: Array
    score_share: Array

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of S."""
        low, high = np.quantile(self.draws[:, 0], (0.025, 0.975))
        return float(low), float(high)


class Flexible:
    """Flexible corrections of the fit runs, and their values on the runs that judge."""

    def __init__(self, judged: Judged) -> None:
        self.made = Designs.of(judged.problem.dataset)
        self.held = {} if judged.hold is None else self.made.on(judged.hold.dataset)

    def rows(self, judged: Judged) -> Array:
        """Residual of `judged.bench` after a correction of every output.

        None of it was fitted to the run that it corrects.
        """
        problem, hold = judged.problem, judged.hold
        bench = judged.bench
        residual = problem.dataset.residual(judged.left_out + problem.background)
        out = bench.dataset.residual(judged.predicted + bench.background).copy()
        for key in problem.dataset.keys:
            correction, left_out = fit_correction(self.made, residual, problem.whitening.s, key)
            if correction.explained <= 0.0:
                continue
            if hold is None:
                out -= left_out
            else:
                for seg in hold.dataset.rows_of(key):
                    out[seg.rows] -= self.held[seg.run, seg.side] @ correction.weights
        return np.where(bench.dataset.valid, out, 0.0)


def excess_draws(problem: Problem, squares: Array, keys: Sequence[str], weights: Array) -> Array:
    """G over the floor of `keys` for each row of bootstrap `weights` over cells; shape (draws,)."""
    ev = problem.dataset
    q = ev.cell_sum(np.where(ev.valid, squares, 0.0))
    parts = []
    for key in keys:
        mine = ev.cell_key == key
        count = weights[:, mine] @ ev.cell_size[mine]
        parts.append(np.maximum(0.0, weights[:, mine] @ q[mine] / np.maximum(count, 1e-9) - 1.0))
    return np.sqrt(np.mean(parts, axis=0)) if parts else np.zeros(len(weights))


@dataclass(frozen=True)
class Remains:
    """What a model leaves on the runs that judge: squares over the floor, score of each cell."""

    squares: Array
    scores: Array

    @classmethod
    def of(cls, bench: Problem, rows: Array) -> Remains:
        return cls(
            np.square(bench.whitening.scale(rows)), bench.cell_score(bench.whitening.white(rows))
        )

    @classmethod
    def left_by(cls, judged: Judged) -> Remains:
        bench = judged.bench
        return cls.of(bench, bench.dataset.residual(judged.predicted + bench.background))


@dataclass(frozen=True)
class Standing:
    """What four models leave of the same rows.

    `refits` are the refit that the selection began with and, if its parameters were free, the one
    by plain least squares: the smaller gap counts, since an effect is never credited with what a
    refit gives. `flexible` are corrections on top of the refit and of the best model.
    """

    problem: Problem
    refits: tuple[Remains, ...]
    final: Remains | None
    flexible: tuple[Remains, ...]

    @classmethod
    def of(cls, selection: Selection, gentle: Judged | None) -> Standing:
        base, best = selection.base.judged, selection.best.judged
        named = bool(selection.best.names)
        flexible = Flexible(base)
        tops = (base, best) if named else (base,)
        return cls(
            best.bench,
            tuple(Remains.left_by(j) for j in (base, gentle) if j is not None),
            Remains.left_by(best) if named else None,
            tuple(Remains.of(best.bench, flexible.rows(j)) for j in tops),
        )

    def worth(self, keys: Sequence[str]) -> Worth:
        """Gaps, shrink and ceiling over some outputs."""
        bench = self.problem

        def gap(r: Remains) -> float:
            return excess_of(bench, r.squares, keys)

        refit = min(self.refits, key=gap)
        final = refit if self.final is None else self.final
        best = min([*self.flexible, final], key=gap)
        ev, settings = bench.dataset, bench.dataset.settings
        rng = np.random.default_rng(settings.seed + 5)
        weights = resample_weights(ev.cell_run, ev.cell_block, DRAWS, rng)
        g = [excess_draws(bench, r.squares, keys, weights) for r in (refit, final, best)]
        safe = np.maximum(g[0], 1e-9)
        draws = np.column_stack([1 - g[1] / safe, 1 - g[2] / safe])
        mine = np.isin(ev.cell_key, list(keys))
        gain = [weights[:, mine] @ (r.scores - refit.scores)[mine] for r in (final, *self.flexible)]
        most = np.maximum(np.max(gain, axis=0), 1e-9)
        return Worth(
            tuple(keys),
            gap(refit),
            gap(final),
            shrink(gap(final), gap(refit)),
            shrink(gap(best), gap(refit)),
            np.clip(draws, -1.0, 1.0),
            np.clip(gain[0] / most, -1.0, 1.0),
        )


def counted_share(one: Hypothesis, other: Hypothesis) -> float:
    """Share, up to 1, of the separation of `one` from `other` that can be counted on.

    Along the difference s of two models the log-likelihood changes by E = Σ w s z in a block of
    time, z being what `one` leaves. Where z varies as Σ says, ΣE² over the blocks is D = Σ w s²;
    where a model of another form leaves more along s, it is more. What can be counted on is
    D²/ΣE², the information of a sandwich estimate of the effect's strength, where d² takes D times
    the effective share of independent rows. All on runs not fitted to.
    """
    along, square, predicted = (np.concatenate(p) for p in zip(*_along(one, other), strict=True))
    varied = float(np.square(block_sums(one.fit.problem, one.judged.hold, along)).sum())
    if varied <= 0.0 or predicted.sum() <= 0.0:
        return 0.0
    return min(1.0, float(square.sum()) ** 2 / varied / float(predicted.sum()))


def _along(one: Hypothesis, other: Hypothesis) -> list[tuple[Array, Array, Array]]:
    """Σ w s z, Σ w s² and its part in d² of every cell of the fit runs, and of those held out."""
    a, b = one.judged, other.judged
    parts = [(a.problem, a.left_out, b.left_out)]
    if a.hold is not None:
        parts.append((a.hold, a.held, b.held))
    out = []
    for problem, mine, theirs in parts:
        ev = problem.dataset
        z = problem.white(mine)
        s = problem.white(theirs) - z
        w = problem.row_weight(z)
        shares = dispersion(problem, z)
        independent = np.array([shares[seg.key] for seg in ev.segments])[ev.cell_segment]
        square = ev.cell_sum(w * s * s)
        out.append((ev.cell_sum(w * s * z), square, square * independent))
    return out


def group_of(
    best: Hypothesis, rivals: Sequence[Hypothesis], probability: dict[str, float], odds: float
) -> list[str]:
    """Names that cannot be told from an effect of `best`, most probable first."""
    if not rivals:
        return []
    own = [n for n in best.names if all(n not in r.names for r in rivals)]
    name = own[0] if own else best.names[-1]
    p_best = probability.get(name, 1.0)
    near = []
    for rival in rivals:
        other = next(n for n in rival.names if n not in best.names)
        p = probability.get(other, 0.0)
        if p > 0 and p_best / p < odds:
            near.append((p, other))
    return [n for _, n in sorted(near, key=lambda pair: (-pair[0], pair[1]))]
