"""The simulator held against runs: parameters, then places whose laws bring it nearer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.data.played import reference_point
from smad.diagnosis.errors import GapError
from smad.diagnosis.gap import Measured, Residual, by_itself, residual
from smad.diagnosis.numerics.folds import Array, FoldRows
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses, candidate_laws, responses
from smad.diagnosis.plant import Effect, ModelPoint, nominal_point, traits_of
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.listed import Listed, listed
from smad.diagnosis.search.names import LIST_GAIN, naming_at
from smad.diagnosis.search.settle import Settler
from smad.diagnosis.search.where import Where, where

Say = Callable[[str], None]
_LONGEST_LIST = 6


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Runs that were admitted: the first `fit` of them to fit, the rest held out; and good ones.

    `floors` (channels,) is the noise of a row of `period_s`, in channel units.
    """

    plant: PlacesPlant
    runs: tuple[GapRun, ...]
    fit: int
    good: tuple[GapRun, ...]
    effects: tuple[Effect, ...]
    period_s: float
    floors: Array
    constants: Constants
    say: Say

    @property
    def judged(self) -> tuple[int, ...]:
        """The runs that figures are of: those held out, else each in turn."""
        held = tuple(range(self.fit, len(self.runs)))
        return held or tuple(range(self.fit))

    @property
    def counts(self) -> tuple[bool, ...]:
        """Which runs laws are selected on."""
        return tuple(k < self.fit for k in range(len(self.runs)))


@dataclass(frozen=True, kw_only=True)
class Held:
    """What holding a simulator against runs gave: the search with names, and the proven list."""

    gap: Residual
    found: Responses
    rows: FoldRows
    where: Where
    listed: Listed

    @property
    def model(self) -> ModelPoint:
        """The simulator with all that brings it nearer."""
        return self.listed.settler.model(self.listed.settled[-1])


def held_against(
    asked: Asked,
    measured: Measured,
    *,
    counts: Sequence[bool],
    beside: Measured | None = None,
    named: bool = True,
) -> Held:
    """Hold the nominal simulator against runs.

    Laws are over the states of these runs and of those `beside`. Raises GapError where the model
    cannot replay a run.
    """
    plant, c, start = asked.plant, asked.constants, nominal_point(asked.plant)
    kept = [k for k, own in enumerate(counts) if own]
    asked.say("parameters")
    point = reference_point(
        plant, start, [measured.played[k] for k in kept],
        measured=[measured.values[k] for k in kept], valid=[measured.valid[k] for k in kept],
        least=asked.floors,
    )  # fmt: skip
    gap = residual(plant, point, measured, counts=counts, least=asked.floors)
    every = measured.played if beside is None else (*measured.played, *beside.played)
    found = responses(
        plant, point, measured.played, space=candidate_laws(plant, point, every),
        progress=asked.say,
    )  # fmt: skip
    drift = traits_of(plant).drift
    wandering = [found.drifts(drift, k) for k in range(len(measured.played))]
    gap = replace(gap, open=by_itself(gap.open, wandering))
    rows = gap.fold_rows(found)
    asked.say("where it lies")
    naming = naming_at(gap, asked.effects) if named else None
    searched = where(
        rows, found.candidates(), c, least=LIST_GAIN, most=_LONGEST_LIST, naming=naming
    )
    asked.say("in the simulator")
    listing = listed(Settler(gap, found, start), rows, searched.steps)
    if listing is None:
        raise cannot_replay(gap)
    return Held(gap=gap, found=found, rows=rows, where=searched, listed=listing)


def cannot_replay(gap: Residual) -> GapError:
    """The model gives no numbers for the runs."""
    bad = [
        p.whole.name for p, b in zip(gap.played, gap.base, strict=True) if not np.isfinite(b).all()
    ]
    return GapError(
        "the model cannot replay these runs",
        value=", ".join(bad) or "with its parameters moved",
        action="leave them out, or mend the model where it stops",
    )
