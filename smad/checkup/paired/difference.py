"""The paired residual: (measured now − predicted now) − (measured then − predicted then)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.checkup.paired.reference import Reference, RunReference, day_directions
from smad.diagnosis.data.played import Played, predictions, scaled_signatures
from smad.diagnosis.data.rows import (
    binned,
    offset_s,
    require_like_inputs,
    same_inputs,
    without_other_end,
)
from smad.diagnosis.errors import PairingError
from smad.diagnosis.gap import Gap
from smad.diagnosis.numerics.white import RunRows, White
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import (
    Array,
    Mask,
    ModelPoint,
    PlantModel,
    Uncertainty,
    moved_parameters,
    traits_of,
)
from smad.diagnosis.runs import GapRun

SHARE = 0.05
"""How far a parameter may have moved between two days, in its prior's standard deviations."""
_LEAST_ROWS = 50


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Paired(Gap):
    """All pairs of a check-up, beside what parameters may have moved between days."""

    reference: Reference
    pairs: tuple[Pair, ...]

    @cached_property
    def slopes(self) -> Array:
        """White slopes of all parameters, (parameters, rows), days taken off."""
        return self.white([p.reference.slopes for p in self.pairs])

    @cached_property
    def untied(self) -> Array:
        """White difference with no parameter moved; shape (rows,)."""
        return np.asarray(self.white([d[None] for d in self.difference])[0])

    @cached_property
    def moved(self) -> tuple[ModelPoint, Uncertainty]:
        """The reference with the parameters that now is likeliest with, and how sure they are."""
        J, own = self.slopes, self.plant.parameters
        covariance = np.linalg.inv(J @ J.T + np.eye(len(J)))
        sd = np.array([q.prior_sd for q in own])
        theta = moved_parameters(self.plant, self.point, covariance @ (J @ self.untied))
        names = tuple(q.name for q in own)
        point = replace(self.point, theta=theta)
        return point, Uncertainty(names, sd[:, None] * covariance * sd)

    @property
    def responses(self) -> Responses:
        """Responses of the run that each pair repeats."""
        known = self.reference.responses
        of_run = {r.name: x for r, x in zip(self.reference.runs, known.runs, strict=True)}
        return replace(known, runs=tuple(of_run[p.reference.name] for p in self.pairs))

    @cached_property
    def signatures(self) -> Array:
        """White signatures of all atoms beside tied parameters; (atoms, rows).

        Those of runs with other inputs are made anew for these.
        """
        atoms = self.reference.atoms
        return self.rows([
            scaled_signatures(self.plant, self.point, p.played, p.base, atoms)
            if p.carried else p.reference.signatures
            for p in self.pairs
        ])  # fmt: skip


def paired(plant: PlacesPlant, reference: Reference, runs: Sequence[tuple[GapRun, str]]) -> Paired:
    """Pairs of `runs`, each with the name of the run of the reference that it repeats.

    Raises PairingError for inputs that differ too much and when too little is left to judge.
    """
    by_name = {r.name: r for r in reference.runs}
    pairs = tuple(_pair(plant, reference, run, by_name[name]) for run, name in runs)
    count = sum(int(p.rows.valid.sum()) for p in pairs)
    if count < _LEAST_ROWS:
        raise PairingError(
            "too little was recorded both then and now to judge",
            value=f"{count} readings on the grid",
            limit=_LEAST_ROWS,
            action="play the runs again to their end",
        )
    # Responses are of the good run's inputs: runs with others count in no fold beside the rest.
    same = tuple(not p.carried for p in pairs)
    return Paired(
        plant=plant, point=reference.point, played=tuple(p.played for p in pairs),
        base=tuple(p.base for p in pairs), difference=tuple(p.difference for p in pairs),
        white=White(tuple(p.rows for p in pairs)),
        open=tuple(SHARE * p.reference.slopes for p in pairs),
        counts=same if any(same) else (True,) * len(pairs), reference=reference, pairs=pairs,
    )  # fmt: skip


def _pair(plant: PlantModel, reference: Reference, run: GapRun, then: RunReference) -> Pair:
    start = then.played.start_s + offset_s(run, then.played.whole)
    now = binned(run, then.played.bins, plant, start)
    now = without_other_end(now, then.inputs)
    require_like_inputs(now, then.inputs)
    around = run.at_start(traits_of(plant).environment.values())
    other = not same_inputs(now, then.inputs)
    difference = now.values - then.mean
    played, base = then.played, then.base
    again = _again(then, run if other else None, around, start)
    found = predictions(plant, reference.point, [again])[0]
    moved = np.where(np.isfinite(found) & now.covered[:, None], found - base, 0.0)
    if other:
        played, base = again, base + moved
    difference = difference - moved
    valid = now.valid & then.valid & now.covered[:, None]
    rows = rows_of(plant, reference, then, valid).carried(moved)
    return Pair(
        now=run.name, reference=then, difference=difference, rows=rows, share=now.share,
        carried=other, around=around, played=played, base=base,
    )  # fmt: skip


def rows_of(plant: PlantModel, reference: Reference, then: RunReference, valid: Mask) -> RunRows:
    """White space of one more recording of a run, `valid` where it has readings."""
    day = day_directions(plant, then.slopes, then.base)
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
