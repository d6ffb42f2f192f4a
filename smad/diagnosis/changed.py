"""What is new since the good runs, whatever their inputs.

The reference is the simulator with what good runs have taught it: parameters and laws, proven on
runs left out. A place is new by what a law for the runs in question alone adds, beside a law of the
same terms that good runs share; so what the simulator still gets wrong everywhere counts nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.data.played import slopes
from smad.diagnosis.gap import Measured, Residual, by_itself, kept_in, neighbours, row_scale
from smad.diagnosis.numerics.folds import Array, FoldRows
from smad.diagnosis.numerics.forward import held_out
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses, responses
from smad.diagnosis.plant import traits_of
from smad.diagnosis.search.contrast import Contrast, contrast
from smad.diagnosis.search.listed import Listed, listed
from smad.diagnosis.search.names import naming_at
from smad.diagnosis.search.settle import Settler
from smad.diagnosis.search.where import WORTH_TELLING
from smad.diagnosis.simulator import Asked, cannot_replay, held_against
from smad.diagnosis.verdict import PARAMETERS, PLACES, QUIET, UNPLACED

PARAMETERS_FIRST = 0.8
"""Other values of the parameters are the answer when they take so much of what places take."""
_TIE = 0.3
"""How far parameters of a bench may have moved since its good runs, in prior deviations."""
_DAY = 0.05
"""The same from one day to the next."""


@dataclass(frozen=True, kw_only=True)
class Changed:
    """What is new: `outcome`, the contrast with names, and the list proven in the simulator.

    `joint` is the gap of good runs and runs in question together, `rows` those that the laws in
    question were fitted to. `parameters` is the share of the rows in question that other values of
    the parameters take.
    """

    outcome: str
    contrast: Contrast
    joint: Residual
    rows: FoldRows
    parameters: float
    listed: Listed


def changed(asked: Asked) -> Changed:
    """Return what is new in the runs since the good ones. Raises GapError as `held_against`."""
    c, plant = asked.constants, asked.plant
    good = Measured.of(plant, asked.good, asked.period_s)
    now = Measured.of(plant, asked.runs, asked.period_s)
    every = range(len(asked.good))
    taught = held_against(asked, good, counts=[True for _ in every], beside=now, named=False)
    left = [y - p for y, p in zip(good.values, taught.listed.predicted[-1], strict=True)]
    scale = row_scale(left, good.valid, asked.floors)
    found = responses(plant, taught.model, now.played, space=taught.found.laws, progress=asked.say)
    both = replace(taught.found, runs=(*taught.found.runs, *found.runs))
    only = (*(False for _ in every), *(True for _ in asked.runs))
    J = slopes(plant, taught.model, (good + now).played)
    joint = Residual.of(
        plant, taught.model, good + now, scale=scale, rho=neighbours(left, good.valid),
        counts=(*(True for _ in every), *asked.counts), left_open=_open(plant, J, both),
    )  # fmt: skip
    at = np.flatnonzero((joint.run_of_row >= len(asked.good)) & (joint.fold >= 0))
    asked.say("what is new")
    moved = FoldRows(joint.z, joint.rows(kept_in(only, J)).astype(np.float32), joint.fold)
    square = max(float(joint.z[at] @ joint.z[at]), 1e-12)
    parameters = held_out(moved.products(), np.unique(joint.fold[at]), prior=1.0) / square
    news = contrast(
        joint.fold_rows(both, only), at, both.candidates(), c, run_of_row=joint.run_of_row,
        only=only, naming=naming_at(joint, asked.effects, only),
    )  # fmt: skip
    # Parameters are asked first: they are the answer if they take nearly what places take.
    told = min(news.steps[-1].share, 1.0) if news.steps else 0.0
    free = parameters >= max(PARAMETERS_FIRST * told, WORTH_TELLING)
    gap = Residual.of(plant, taught.model, now, scale=scale, counts=asked.counts)
    settler = Settler(gap, found, taught.model, spread=1.0 if free else _DAY)
    mine, own = joint.run_of_row >= len(asked.good), news.own
    rows = replace(own, rows=own.rows[mine], responses=own.responses[:, mine], fold=own.fold[mine])
    listing = listed(settler, rows, () if free else news.steps)
    if listing is None:
        raise cannot_replay(gap)
    otherwise = PARAMETERS if free else UNPLACED if news.steps else QUIET
    return Changed(
        outcome=PLACES if listing.steps else otherwise, contrast=news, joint=joint, rows=rows,
        parameters=parameters, listed=listing,
    )  # fmt: skip


def _open(plant: PlacesPlant, J: Sequence[Array], found: Responses) -> tuple[Array, ...]:
    """What stays open beside slopes `J` a run.

    Parameters within `_TIE`; in each run by itself those of a day, and what wanders.
    """
    traits = traits_of(plant)
    at = [n for n, q in enumerate(plant.parameters) if q.name in traits.day]
    share = np.array([traits.day[plant.parameters[n].name] for n in at])[:, None, None]
    own = [np.concatenate([share * j[at], found.drifts(traits.drift, k)]) for k, j in enumerate(J)]
    return by_itself([_TIE * j for j in J], own)
