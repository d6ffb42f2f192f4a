"""What a check-up found as a verdict: its budget, its runs, and what a reader must know of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.checkup.paired.difference import Paired
from smad.diagnosis.budget import Budget, budget_of
from smad.diagnosis.plant import Array
from smad.diagnosis.search.locate import Located
from smad.diagnosis.search.told import parameters_told, place_shares, unseen, unseen_effects
from smad.diagnosis.verdict import (
    CHECK_UP,
    PARAMETERS,
    PLACES,
    ParameterTold,
    RunGap,
    Verdict,
    change_headline,
)
from smad.version import VERSION


def verdict_of(paired: Paired, located: Located, outcome: str, least: float) -> Verdict:
    """The verdict. `least` is the gain, in squares of rows, that a place must have to be seen."""
    places = list(located.told) if outcome == PLACES else []
    budget = budget_of_pairs(paired, located.changes if places else ())
    ranked = located.where.ranked
    known = paired.reference.atoms
    return Verdict(
        question=CHECK_UP,
        outcome=outcome,
        headline=change_headline(outcome, places, "no change beyond the repeat floor"),
        places=places,
        parameters=_moved(paired) if outcome == PARAMETERS else [],
        budget=budget.signals,
        whole=budget.whole,
        by_run=[
            RunGap(run=p.now, raw=float(raw), parameters=float(final[0]), final=float(final[-1]))
            for p, (raw, *final) in zip(paired.pairs, budget.by_run.T, strict=True)
        ],
        ranked=place_shares(paired.plant, ranked),
        judged_on="each run by laws of the others",
        unseen=[
            *unseen_effects(paired.plant.effects, known, paired.signatures, least),
            *unseen(paired.plant, located.rows, ranked, least),
        ],
        notes=[*_otherwise(outcome, located), *_notes(paired)],
        plant=paired.plant.name,
        plant_version=paired.plant.version,
        smad_version=VERSION,
    )


def _moved(paired: Paired) -> list[ParameterTold]:
    """The parameters, those first that moved most beside their deviation."""
    found = parameters_told(paired.plant, paired.point, *paired.moved)
    return sorted(found, key=lambda q: -abs(q.after - q.before) / max(q.sd, 1e-30))


def _otherwise(outcome: str, located: Located) -> list[str]:
    if outcome != PARAMETERS or not located.told:
        return []
    first = located.told[0]
    return [
        f"if no parameter has moved, it lies likeliest here: {first.words}, probability "
        f"{first.probability:.2f}"
    ]


def budget_of_pairs(paired: Paired, changes: Sequence[Sequence[Array]]) -> Budget:
    """What is left of the differences, stage by stage.

    Raw; less days and small moves of parameters; and less what the model makes of the first
    1, 2 … places (`changes`) as well.
    """
    raw = [p.difference for p in paired.pairs]
    less = [[d - c for d, c in zip(raw, own, strict=True)] for own in changes]
    tied = paired.rows(paired.open)
    stages = [raw, *(_without_days(paired, tied, x) for x in (raw, *less))]
    rows = [p.rows for p in paired.pairs]
    channels = paired.plant.channels
    return budget_of(channels, stages, [r.valid for r in rows], [r.sd for r in rows])


def _without_days(paired: Paired, tied: Array, difference: list[Array]) -> list[Array]:
    """The difference less the most likely day of each run and the parameters' small move.

    `tied` (parameters, rows) are the white rows of what parameters may move.
    """
    r = paired.rows([d[None] for d in difference])[0]
    # The posterior mean of directions that were shrunk is their product with the white rows.
    theta = tied @ r
    out = []
    for p, d, free in zip(paired.pairs, difference, paired.open, strict=True):
        moved = d - np.tensordot(theta, free, axes=1)
        own = p.rows.shrink(p.rows.independent(moved[None]))[0]
        days = p.rows.shrink(p.rows.days) @ own
        out.append(moved - np.tensordot(days * p.rows.day_sd, p.rows.day, axes=1))
    return out


def _notes(paired: Paired) -> list[str]:
    out = []
    if paired.reference.repeats < 2:
        out.append(
            "a run was recorded good only once: the repeat floor is a guess; record it again "
            "on another day"
        )
    for p in paired.pairs:
        if p.share < 0.98:
            out.append(
                f"{p.now} counts as far as it goes: {100 * p.share:.0f} % of it was recorded"
            )
        if p.carried:
            out.append(f"{p.now}: inputs differed from the good run's; the model carried that over")
    if lost := _lost(paired):
        out.append(f"recorded then and not now, and left out: {lost}")
    warm = [
        f"{c} {p.around[c] - p.reference.around[c]:+.1f} K in {p.now}"
        for p in paired.pairs
        for c in p.around
        if c in p.reference.around and abs(p.around[c] - p.reference.around[c]) > 1.0
    ]
    if warm:
        out.append("carried over by the model: " + ", ".join(warm))
    return out


def _lost(paired: Paired) -> str:
    """Channels of which now most readings are missing that the good runs have, with the runs."""
    runs: dict[str, list[str]] = {}
    for p in paired.pairs:
        had, has = p.reference.valid.sum(axis=0), p.rows.valid.sum(axis=0)
        for c, then, now in zip(paired.plant.channels, p.share * had, has, strict=True):
            if now < 0.5 * then:
                runs.setdefault(c.name, []).append(p.now)
    return ", ".join(f"{channel} ({', '.join(own)})" for channel, own in runs.items())
