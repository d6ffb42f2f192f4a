"""The paired residual: (measured now − predicted now) − (measured then − predicted then)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.checkup.paired.reference import Reference, RunReference, day_directions
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.data.rows import (
    binned,
    offset_s,
    require_like_inputs,
    same_inputs,
    without_other_end,
)
from smad.diagnosis.errors import PairingError
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses, Singles
from smad.diagnosis.plant import Array, Mask, PlantModel, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.evidence import Evidence, Trial
from smad.diagnosis.runs import GapRun

_LEAST_ROWS = 50


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A run of now beside its reference. `share` of the programme's run was recorded; `carried`
    says that inputs differed and the model carried the difference over. `played` is what the model
    replays: the surroundings of now with the reference's inputs, or with the run's own where they
    were carried. `target` (bins, channels) is what it should show: what the reference model shows
    there, and what the bench has changed by."""

    now: str
    reference: RunReference
    target: Array
    rows: RunRows
    share: float
    carried: bool
    around: Mapping[str, float]
    played: Played


@dataclass(frozen=True, kw_only=True)
class Paired:
    """All pairs of a check-up beside the good bench."""

    plant: PlacesPlant
    reference: Reference
    pairs: tuple[Pair, ...]

    def evidence(self) -> Evidence:
        """The pairs as rows."""
        return Evidence(
            trials=tuple(Trial(played=p.played, target=p.target, rows=p.rows) for p in self.pairs)
        )

    @property
    def responses(self) -> Responses | None:
        """Responses of the run that each pair repeats; None where a run has other inputs."""
        known = self.reference.responses
        runs = self._repeated(known.runs)
        return None if runs is None else replace(known, runs=runs)

    @property
    def changes(self) -> Changes | None:
        """What effects change of those runs, in the surroundings of then; None as above."""
        known = self.reference.changes
        runs = self._repeated(known.runs)
        return None if runs is None else replace(known, runs=runs)

    def _repeated(self, of_runs: Sequence[Singles]) -> tuple[Singles, ...] | None:
        """Of arrays of the reference's runs, that of each pair."""
        if any(p.carried for p in self.pairs):
            return None
        of_run = {r.name: x for r, x in zip(self.reference.runs, of_runs, strict=True)}
        return tuple(of_run[p.reference.name] for p in self.pairs)


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
    return Paired(plant=plant, reference=reference, pairs=pairs)


def _pair(plant: PlantModel, reference: Reference, run: GapRun, then: RunReference) -> Pair:
    start = then.played.start_s + offset_s(run, then.played.whole)
    now = binned(run, then.played.bins, plant, start)
    now = without_other_end(now, then.inputs)
    require_like_inputs(now, then.inputs)
    around = run.at_start(traits_of(plant).environment.values())
    other = not same_inputs(now, then.inputs)
    again = _again(then, run if other else None, around, start)
    (predicted,) = predictions(plant, reference.point, [again], exact=True)
    moved = np.where(np.isfinite(predicted) & now.covered[:, None], predicted - then.base, 0.0)
    # In the surroundings of now, since what has changed may act otherwise there.
    target = predicted + (now.values - then.mean) - moved
    valid = now.valid & then.valid & now.covered[:, None]
    rows = rows_of(plant, reference, then, valid, moved)
    return Pair(
        now=run.name,
        reference=then,
        target=target,
        rows=rows,
        share=now.share,
        carried=other,
        around=around,
        played=again,
    )


def rows_of(
    plant: PlantModel, reference: Reference, then: RunReference, valid: Mask, moved: Array
) -> RunRows:
    """White space of one more recording of a run, `valid` where it has readings.

    `moved` (bins, channels) is what the model carried over.
    """
    day = day_directions(plant, then.slopes, then.base, moved)
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
    begin_s = then.played.start_s if run is None else start_s
    return replace(Played.of(again, then.played.inputs, begin_s), bins=then.played.bins)
