"""What a check-up found as a verdict: its budget, its runs, and what a reader must know of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.checkup.paired.difference import SHARE, Paired
from smad.diagnosis.gap import rms
from smad.diagnosis.plant import Array, Mask
from smad.diagnosis.search.locate import Located
from smad.diagnosis.search.told import place_shares, unseen, unseen_effects
from smad.diagnosis.verdict import (
    CHECK_UP,
    PARAMETERS,
    PLACES,
    QUIET,
    PlaceTold,
    RunGap,
    SignalGap,
    Verdict,
    change_headline,
)
from smad.version import VERSION


def verdict_of(paired: Paired, located: Located, outcome: str, least: float) -> Verdict:
    """The verdict. `least` is the gain, in squares of rows, that a place must have to be seen."""
    places = list(located.told) if outcome == PLACES else []
    changes = located.changes if places else ()
    stages = stages_of(paired, changes)
    budget, whole = budget_of(paired, stages)
    ranked = located.where.ranked
    known = paired.reference.atoms
    return Verdict(
        question=CHECK_UP,
        outcome=outcome,
        headline=_headline(outcome, places),
        places=places,
        budget=budget,
        whole=whole,
        by_run=_by_run(paired, stages),
        ranked=place_shares(paired.plant, ranked),
        judged_on="each run by laws of the others",
        unseen=[
            *unseen_effects(paired.plant.effects, known, paired.signatures, least),
            *unseen(paired.plant, located.rows, ranked, least),
        ],
        notes=_notes(paired),
        plant=paired.plant.name,
        plant_version=paired.plant.version,
        smad_version=VERSION,
    )


def _headline(outcome: str, places: Sequence[PlaceTold]) -> str:
    if outcome == QUIET:
        return "no change beyond the repeat floor"
    if outcome == PARAMETERS:
        return "changed: other values of the parameters explain it"
    return change_headline(places)


def stages_of(paired: Paired, changes: Sequence[Sequence[Array]]) -> list[list[Array]]:
    """What is left of the difference of each pair, (bins, channels), stage by stage.

    Raw; less days and small moves of parameters; and less what the model makes of the first
    1, 2 … places (`changes`) as well.
    """
    raw = [p.difference for p in paired.pairs]
    less = [[d - c for d, c in zip(raw, own, strict=True)] for own in changes]
    tied = SHARE * paired.tie(paired.slopes)
    return [raw, *(_without_days(paired, tied, x) for x in (raw, *less))]


def budget_of(
    paired: Paired, stages: Sequence[Sequence[Array]]
) -> tuple[list[SignalGap], SignalGap]:
    """The stages by signal, and over all signals in floors."""
    valid = [p.rows.valid for p in paired.pairs]
    sd = [p.rows.sd for p in paired.pairs]
    table = np.array([rms(x, valid) for x in stages])
    floor = rms(sd, valid)
    there: Mask = np.concatenate(valid).sum(axis=0) > 0
    budget = [
        SignalGap(
            signal=c.name, unit=c.unit, floor=float(floor[i]), raw=float(table[0, i]),
            parameters=float(table[1, i]), places=[float(x) for x in table[2:, i]],
        )
        for i, c in enumerate(paired.plant.channels)
        if there[i]
    ]  # fmt: skip
    every = range(len(paired.pairs))
    total = [_in_floors(paired, x, every) for x in stages]
    whole = SignalGap(
        signal="all signals", unit="floors", floor=1.0, raw=total[0], parameters=total[1],
        places=total[2:],
    )  # fmt: skip
    return budget, whole


def _by_run(paired: Paired, stages: Sequence[Sequence[Array]]) -> list[RunGap]:
    raw, parameters, *_ = stages
    return [
        RunGap(
            run=p.now,
            raw=_in_floors(paired, raw, [k]),
            parameters=_in_floors(paired, parameters, [k]),
            final=_in_floors(paired, stages[-1], [k]),
        )
        for k, p in enumerate(paired.pairs)
    ]  # fmt: skip


def _in_floors(paired: Paired, left: Sequence[Array], pairs: Sequence[int]) -> float:
    rows = np.concatenate(
        [(left[k] / paired.pairs[k].rows.sd)[paired.pairs[k].rows.valid] for k in pairs]
    )
    return float(np.sqrt(np.mean(rows**2)))


def _without_days(paired: Paired, tied: Array, difference: list[Array]) -> list[Array]:
    """The difference less the most likely day of each run and the parameters' small move.

    `tied` (parameters, rows) are the white slopes of what parameters may move.
    """
    r = paired.tie(paired.white([d[None] for d in difference]))[0]
    # The posterior mean of directions that were shrunk is their product with the white rows.
    theta = tied @ r * SHARE
    out = []
    for p, d in zip(paired.pairs, difference, strict=True):
        moved = d - np.tensordot(theta, p.reference.slopes, axes=1)
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
