"""Where, which law, what name, of one check-up: the search, read off and tried in the simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sim_device.plant.laws import Law, joined
from smad.diagnosis.constants import Constants
from smad.diagnosis.data.played import finite, predictions
from smad.diagnosis.gap import Gap, with_effects
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.diagnosis.search.names import Naming
from smad.diagnosis.search.refine import Refined, without
from smad.diagnosis.search.told import Teller, words_of
from smad.diagnosis.search.where import Fits, Scored, Step, Where, fits, where
from smad.diagnosis.verdict import PlaceTold


@dataclass(frozen=True)
class Alternative:
    """A place that may be the one, in words, and the law that it would have alone."""

    words: str
    laws: tuple[Law, ...]


@dataclass(frozen=True, kw_only=True)
class Located:
    """Places that were told, and what explains them: effects where one is named, laws elsewhere.

    `model` is the reference with them, `laws` are those of every place, for figures. `changes` are
    what the simulator makes of the first 1, 2 … places, (bins, channels) a pair, each pair with
    coefficients that it had no part in; a place that does not bring the simulator nearer has none,
    nor those after it. `alternatives` are the places of the first answer between which these runs
    do not decide.
    """

    told: tuple[PlaceTold, ...]
    laws: tuple[Law, ...]
    model: ModelPoint
    uncertainty: Uncertainty | None
    changes: tuple[tuple[Array, ...], ...]
    alternatives: tuple[Alternative, ...]
    where: Where
    rows: FoldRows

    @property
    def left(self) -> float:
        """What all places leave of the rows' sum of squares."""
        steps = self.where.steps
        return self.rows.square - (steps[-1].share * self.where.size if steps else 0.0)


def locate(
    gap: Gap, found: Responses, naming: Naming, *, constants: Constants, most: int
) -> Located:
    """Search the places of a check-up, `most` of them at most.

    A further place counts only if it brings the simulator nearer to the bench, in runs that had no
    part in it.
    """
    rows = gap.fold_rows(found)
    w = where(
        rows, found.candidates(), constants, least=constants.quiet_gain, most=most,
        size=rows.square - constants.quiet_variance * rows.count, naming=naming, effects_stand=True,
    )  # fmt: skip
    nearer, changes = _tried(gap, found, rows, w.steps)
    shown = nearer or w.steps[:1]
    kept = _Kept(rows, nearer)
    names, scale = found.coefficients(kept.own.columns)
    covariance = scale[:, None] * kept.own.fit.covariance * scale
    teller, before = Teller(gap, found, fits(rows, shown)), (0.0, *(s.share for s in shown))
    return Located(
        told=tuple(
            teller.told(s, s.share - b, in_simulator=bool(nearer))
            for s, b in zip(shown, before, strict=False)
        ),
        laws=tuple(law for s in shown for law in law_alone(found, rows, s, s.chosen)),
        model=replace(
            with_effects(gap.point, {e.name: e.values for e in kept.standing}),
            laws=found.law_of(kept.own.columns, kept.own.fit.mean),
        ),
        uncertainty=Uncertainty(names, covariance) if names else None,
        changes=tuple(changes),
        alternatives=tuple(
            Alternative(words_of(gap.plant, near.candidate), law_alone(found, rows, s, near))
            for s in shown[:1] for near in s.near
        ),
        where=w, rows=rows,
    )  # fmt: skip


@dataclass(frozen=True)
class _Kept:
    """Some steps as a model: effects where they stand, and laws of the others together."""

    rows: FoldRows
    steps: Sequence[Step]

    @cached_property
    def standing(self) -> list[Refined]:
        """The effects that stand in place of a law."""
        return [s.entry for s in self.steps if s.stands and s.entry is not None]

    @cached_property
    def own(self) -> Fits:
        """The laws of the other steps, fitted beside the effects."""
        less = sum((e.change for e in self.standing), np.zeros(len(self.rows.rows)))
        left = replace(self.rows, rows=self.rows.rows - less)
        return fits(left, [s for s in self.steps if not s.stands])


def law_alone(found: Responses, rows: FoldRows, step: Step, chosen: Scored) -> tuple[Law, ...]:
    """The law that a step would have at the place of `chosen`, beside nothing else."""
    own = fits(rows, [replace(step, chosen=chosen)])
    return found.law_of(own.columns, own.fit.mean)


def _tried(
    gap: Gap, found: Responses, rows: FoldRows, steps: Sequence[Step]
) -> tuple[list[Step], list[tuple[Array, ...]]]:
    """The steps that bring the simulator nearer, and what it makes of the first 1, 2 … of them."""
    kept: list[Step] = []
    changes: list[tuple[Array, ...]] = []
    least = float(gap.z @ gap.z)
    for step in steps:
        change = _in_simulator(gap, found, _Kept(rows, [*kept, step]), rows.fold)
        if change is None:
            continue
        left = gap.z - gap.rows([c[None] for c in change])[0]
        if (square := float(left @ left)) < least:
            least = square
            kept.append(step)
            changes.append(change)
    return kept, changes


def _in_simulator(gap: Gap, found: Responses, kept: _Kept, fold: Index) -> tuple[Array, ...] | None:
    """The change of each run with effects and laws fitted without it; None where the model cannot
    simulate it."""
    own, point, out = kept.own, gap.point, []
    for k, (played, base) in enumerate(zip(gap.played, gap.base, strict=True)):
        mine = np.unique(fold[(gap.run_of_row == k) & (fold >= 0)])
        others = (fold >= 0) & ~np.isin(fold, mine)
        effects = {e.name: without(e, kept.rows.rows, others) for e in kept.standing}
        values = np.mean([own.without[f] for f in mine], axis=0) if len(mine) else own.fit.mean
        laws = joined((*point.laws, *found.law_of(own.columns, values)))
        model = replace(with_effects(point, effects), laws=laws)
        (moved,) = predictions(gap.plant, model, [played])
        if not finite([moved]):
            return None
        out.append(moved - base)
    return tuple(out)
