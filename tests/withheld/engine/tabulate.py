"""Fits the hypotheses of a question and judges them on runs that they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.gap.compare.assess import Flexible
from smad.gap.compare.contrast import as_in_good_runs
from smad.gap.compare.select import short_list
from smad.gap.data.replay import Detail
from smad.gap.fit.candidate import held_cells
from smad.gap.fit.joint import JointFit, Start, joint_fits
from smad.gap.fit.judge import Judged, judge
from smad.gap.fit.lsq import Fitted
from smad.gap.fit.screen import Probes, probe, reprobe, screen
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Array, Effect
from tests.withheld.engine.table import Kind, Row, ScoreTable, joined

_FURTHER = 3
"""How many fewer candidates come to a joint fit beside an entry than alone."""
_HELD = (Kind.NOTHING, Kind.KNOWN)
"""Kinds in which the parameters should be where they were."""
_WORTH = 0.1
"""Nats a cell that an entry must gain for a further one to be looked for beside it."""


@dataclass(frozen=True)
class Entrant:
    """A hypothesis that was fitted: what it predicts of runs that it was not fitted to."""

    row: int
    joint: JointFit
    judged: Judged


class Tabulation:
    """The score table of a question, as it is filled."""

    def __init__(
        self, prepared: Prepared, form: float, progress: Callable[[str], None] = lambda text: None
    ) -> None:
        self.prepared, self.form, self.progress = prepared, form, progress
        self.problem, self.hold = prepared.problem, prepared.hold
        self.parts = [p for p in (self.problem, self.hold) if p is not None]
        run, block = held_cells(self.problem, self.hold)
        evidences = [p.evidence for p in self.parts]
        self.table = ScoreTable(
            (),
            joined([ev.cell_size for ev in evidences]),
            run,
            block,
            tuple(str(k) for ev in evidences for k in ev.cell_key),
            prepared.settings.cell_dof,
        )

    def add(
        self,
        kind: Kind,
        names: Sequence[str],
        residuals: Sequence[Array],
        *,
        fit: Fitted | None = None,
        parent: int = -1,
    ) -> int:
        """A row from the residuals that it leaves of the runs to fit and of those held out."""
        q = joined(
            [p.cell_q(p.whitening.white(r)) for p, r in zip(self.parts, residuals, strict=True)]
        )
        unsure = self._unsure(fit) if fit is not None and fit.space.effects else np.zeros_like(q)
        moved = 0.0 if fit is None or kind not in _HELD else _moved(self.prepared, fit)
        row = Row(kind, tuple(names), q, unsure, parent, moved)
        self.table = replace(self.table, rows=(*self.table.rows, row))
        return len(self.table.rows) - 1

    def judged(
        self, kind: Kind, joint: JointFit, judged: Judged, names: Sequence[str], parent: int
    ) -> Entrant:
        """A row from a fit that was judged."""
        row = self.add(kind, names, self.left(judged), fit=joint.fit, parent=parent)
        return Entrant(row, joint, judged)

    def left(self, judged: Judged) -> list[Array]:
        """What a model leaves of the runs to fit, each without itself, and of those held out."""
        predicted = [judged.left_out, judged.held]
        return [
            p.evidence.residual(y + p.background)
            for p, y in zip(self.parts, predicted, strict=False)
        ]

    def _unsure(self, fit: Fitted) -> Array:
        """Mean square of what the entries of a fit change in each cell, white as residuals are."""
        points = [fit.point, *(fit.without(e.name) for e in fit.space.effects)]
        out = []
        for p, detail in zip(self.parts, (None, Detail.FINE), strict=False):
            predicted = p.evidence.predict(points, detail=detail)
            change = p.whitening.white(np.ascontiguousarray((predicted[0] - predicted[1:]).T))
            square = p.evidence.cell_sum(np.square(change).sum(axis=1))
            out.append(square / np.maximum(p.evidence.cell_size, 1.0))
        return joined(out)

    def gain(self, row: int) -> tuple[float, float]:
        """What a row gains over the one before it, and the standard error over blocks of time."""
        scores = self.table.scores(self.form)
        rise = scores[row] - scores[self.table.rows[row].parent]
        blocks = np.unique(np.column_stack([self.table.run, self.table.block]), axis=0,
                           return_inverse=True)[1].ravel()  # fmt: skip
        sums = np.bincount(blocks, weights=rise)
        return float(sums.sum()), float(np.std(sums) * np.sqrt(len(sums)))


def _moved(prepared: Prepared, fit: Fitted) -> float:
    """Half the squared distance of a fit's parameters from those of the known-good runs."""
    own = (fit if prepared.tied is None else prepared.tied).space
    mean, precision = own.prior()
    off = fit.p[: own.n_theta] - mean[: own.n_theta]
    return float(0.5 * off @ precision[: own.n_theta, : own.n_theta] @ off)


def tabulate(
    prepared: Prepared,
    effects: Sequence[Effect],
    form: float,
    progress: Callable[[str], None] = lambda text: None,
) -> ScoreTable:
    """The score table of a question.

    The model as it was, other values of its parameters, every entry that the screening leaves,
    sets of up to three by forward steps, and a flexible model. An entry that known-good runs ask
    for as well is there twice: as it is now, and, as a form of *nothing*, as it was. `form` is the
    share by which entries are uncertain when a further one is sought.
    """
    out = Tabulation(prepared, form, progress)
    base = _references(prepared, out)
    ordered = sorted(effects, key=lambda e: e.name)
    probes = probe(base.joint.fit, ordered)
    current = base
    for size in range(1, prepared.settings.max_effects + 1):
        progress(f"entries, {size} at a time")
        entrants = _entrants(prepared, out, current, probes, first=size == 1)
        if not entrants:
            break
        gains = {e.row: out.gain(e.row) for e in entrants}
        best = max(entrants, key=lambda e: gains[e.row][0])
        if size == 1:
            _as_before(prepared, out, [e for e in entrants if gains[e.row][0] > 0.0])
        gain, error = gains[best.row]
        if gain <= max(2.0 * error, _WORTH * out.table.cells):
            break
        current = best
    return out.table


def _references(prepared: Prepared, out: Tabulation) -> Entrant:
    """The rows without an entry; returns the one that entries are sought beside.

    Known-good runs tie the parameters: one fit stands for the model as it was and for other values
    of them, by how far they have moved. Where parameters and laws are free they follow, dozens of
    them, whatever a bench does: that is the flexible model. Without such runs it is a correction
    that depends on state.
    """
    free = JointFit(prepared.fit, ())
    if prepared.tied is None:
        out.add(Kind.NOTHING, (), out.left(prepared.raw))
        refit = out.judged(Kind.PARAMETERS, free, prepared.free, (), 0)
        out.add(
            Kind.UNKNOWN, (), Flexible(prepared.free).residuals(prepared.free), parent=refit.row
        )
        return refit
    tied = judge([prepared.tied], prepared.hold)[0]
    base = out.judged(Kind.NOTHING, JointFit(prepared.tied, ()), tied, (), -1)
    out.judged(Kind.PARAMETERS, base.joint, tied, (), base.row)
    out.judged(Kind.UNKNOWN, free, prepared.free, (), base.row)
    return base


def _entrants(
    prepared: Prepared, out: Tabulation, current: Entrant, probes: Probes, *, first: bool
) -> list[Entrant]:
    """Sets with one entry more than `current` has, fitted and judged."""
    settings, fit = prepared.settings, current.joint.fit
    ranked = screen(reprobe(probes, fit))
    count = settings.survivors if first else settings.survivors - _FURTHER
    starts = []
    for s in short_list(ranked, count):
        effects, before = (*fit.space.effects, s.effect), dict(fit.point.effects)
        starts += [
            Start(effects, {**before, s.effect.name: values})
            for values in (s.start, s.second)[: settings.starts]
            if values is not None
        ]
        if first and prepared.tied is None:
            starts.append(Start(effects, {s.effect.name: s.start}, from_centre=True))
    joints = list(joint_fits(fit, starts).values()) if starts else []
    judged = judge([j.fit for j in joints], prepared.hold)
    return [
        out.judged(Kind.KNOWN, j, v, j.names, current.row)
        for j, v in zip(joints, judged, strict=True)
    ]


def _as_before(prepared: Prepared, out: Tabulation, entrants: Sequence[Entrant]) -> None:
    """Rows of entries that the known-good runs ask for as well, with the value they had there."""
    if prepared.background is None:
        return
    for entrant in entrants:
        fit = as_in_good_runs(prepared.background.fit, entrant.joint.fit)
        if fit is not None:
            judged = judge([fit], prepared.hold)[0]
            out.add(Kind.NOTHING, entrant.joint.names, out.left(judged))
