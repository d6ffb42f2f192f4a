"""The paired residual: (measured now − predicted now) − (measured then − predicted then)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.gap.paired.errors import PairingError
from smad.gap.paired.model import Played, finite, predictions, scaled_signatures
from smad.gap.paired.reference import (
    Reference,
    RunReference,
    Traits,
    day_directions,
    input_spans,
    start_values,
)
from smad.gap.paired.rows import (
    binned,
    offset_s,
    require_like_inputs,
    same_inputs,
    without_other_end,
)
from smad.gap.paired.white import RunRows, Shrink, White
from smad.gap.plant import Array, EffectValues, Mask, ModelPoint, PlantModel
from smad.gap.runs import GapRun

SHARE = 0.05
"""How far a parameter may have moved between two days, in its prior's standard deviations."""
_LEAST_ROWS = 50


@dataclass(frozen=True)
class Pair:
    """A run of now beside its reference. `share` of the programme's run was recorded; `carried`
    says that inputs differed and the model carried the difference over. `played` is what the model
    replays to tell what an effect changes, `base` its prediction without one: of the reference's
    inputs, or of the run's own where it was carried."""

    now: str
    reference: RunReference
    difference: Array
    rows: RunRows
    share: float
    carried: bool
    around: Mapping[str, float]
    played: Played
    base: Array


@dataclass(frozen=True)
class Paired:
    """All pairs of a check-up, in white space."""

    plant: PlantModel
    traits: Traits
    reference: Reference
    pairs: tuple[Pair, ...]

    @cached_property
    def white(self) -> White:
        return White(tuple(p.rows for p in self.pairs))

    @cached_property
    def tie(self) -> Shrink:
        """Takes off what parameters may have moved between days."""
        return Shrink(SHARE * self.slopes)

    @cached_property
    def slopes(self) -> Array:
        """White slopes of all parameters, (parameters, rows), days taken off."""
        return self.white([p.reference.slopes for p in self.pairs])

    @cached_property
    def untied(self) -> Array:
        """White difference with no parameter moved; shape (rows,)."""
        return np.asarray(self.white([p.difference[None] for p in self.pairs])[0])

    @cached_property
    def z(self) -> Array:
        """White difference beside tied parameters; shape (rows,)."""
        return np.asarray(self.tie(self.untied[None])[0])

    @cached_property
    def signatures(self) -> Array:
        """White signatures of all atoms beside tied parameters; (atoms, rows).

        Those of runs with other inputs are made anew for these.
        """
        other = [i for i, p in enumerate(self.pairs) if p.carried]
        found = [p.reference.signatures for p in self.pairs]
        own = scaled_signatures(
            self.plant,
            self.reference.point,
            [self.pairs[i].played for i in other],
            [self.pairs[i].base for i in other],
            self.reference.atoms,
        )
        for i, signature in zip(other, own, strict=True):
            found[i] = signature
        return self.tie(self.white(found))

    def change(self, effects: EffectValues) -> list[Array] | None:
        """What effects change of each pair; each (bins, channels). None if it cannot be run."""
        own = {**self.reference.point.effects, **effects}
        return self.change_of(ModelPoint(self.reference.point.theta, own))

    def change_of(self, point: ModelPoint) -> list[Array] | None:
        """The same of any model."""
        runs = {id(p.played): p.played for p in self.pairs}
        found = dict(zip(runs, predictions(self.plant, point, list(runs.values())), strict=True))
        if not finite(list(found.values())):
            return None
        return [found[id(p.played)] - p.base for p in self.pairs]

    def white_change(self, effects: EffectValues) -> Array | None:
        """The same in white space beside tied parameters; shape (rows,)."""
        moved = self.change(effects)
        if moved is None:
            return None
        return np.asarray(self.tie(self.white([m[None] for m in moved]))[0])


def paired(
    plant: PlantModel,
    traits: Traits,
    reference: Reference,
    runs: Sequence[tuple[GapRun, str]],
) -> Paired:
    """Pairs of `runs`, each with the name of the run of the reference that it repeats.

    Raises PairingError for inputs that differ too much and when too little is left to judge.
    """
    by_name = {r.name: r for r in reference.runs}
    pairs = tuple(_pair(plant, traits, reference, run, by_name[name]) for run, name in runs)
    count = sum(int(p.rows.valid.sum()) for p in pairs)
    if count < _LEAST_ROWS:
        raise PairingError(
            "too little was recorded both then and now to judge",
            value=f"{count} readings on the grid",
            limit=_LEAST_ROWS,
            action="play the runs again to their end",
        )
    return Paired(plant, traits, reference, pairs)


def _pair(
    plant: PlantModel, traits: Traits, reference: Reference, run: GapRun, then: RunReference
) -> Pair:
    start = then.played.start_s + offset_s(run, then.played.whole)
    now = binned(
        run, then.played.bins, [c.name for c in plant.channels], [s.name for s in plant.inputs],
        start,
    )  # fmt: skip
    spans = input_spans(plant)
    now = without_other_end(now, then.inputs, spans)
    require_like_inputs(now, then.inputs, spans)
    around = start_values(run, list(traits.environment.values()))
    other = not same_inputs(now, then.inputs, spans)
    difference = now.values - then.mean
    played, base = then.played, then.base
    again = _again(then, run if other else None, around, start)
    found = predictions(plant, reference.point, [again])[0]
    moved = np.where(np.isfinite(found) & now.covered[:, None], found - base, 0.0)
    if other:
        played, base = again, base + moved
    difference = difference - moved
    valid = now.valid & then.valid & now.covered[:, None]
    rows = rows_of(plant, traits, reference, then, valid).carried(moved)
    return Pair(
        run.name, then, difference, rows, now.share, other, around, played=played, base=base
    )


def rows_of(
    plant: PlantModel, traits: Traits, reference: Reference, then: RunReference, valid: Mask
) -> RunRows:
    """White space of one more recording of a run, `valid` where it has readings."""
    day = day_directions(plant, traits, then.slopes, then.base)
    inflate = np.sqrt(1.0 + 1.0 / np.maximum(then.count, 1))
    return RunRows(
        sd=reference.floor.of(then.regime, day) * inflate,
        valid=valid,
        day=day,
        day_sd=reference.floor.day_sd * float(inflate.mean()),
        rho=reference.floor.rho,
    )


def _again(
    then: RunReference, run: GapRun | None, around: Mapping[str, float], start_s: float
) -> Played:
    """The reference's run in other surroundings, with the inputs of `run` where it has others."""
    source = then.played.whole if run is None else run
    shown = {c: np.full(len(source.t_s), around.get(c, value)) for c, value in then.around.items()}
    again = GapRun(source.name, source.t_s, source.inputs, shown)
    at = then.played.start_s if run is None else start_s
    return replace(Played.of(again, at), bins=then.played.bins)
