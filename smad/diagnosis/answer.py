"""From what a search proved to a verdict: budgets, laws in words, models."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from smad.diagnosis.budget import budget_of
from smad.diagnosis.changed import Changed
from smad.diagnosis.data.played import predictions
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.forward import Fit
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.plant import ModelPoint, SavesModel, Uncertainty
from smad.diagnosis.search.contrast import apart
from smad.diagnosis.search.listed import Listed
from smad.diagnosis.search.told import Teller, parameters_told, place_shares, unseen
from smad.diagnosis.search.where import WORTH_TELLING, Fits, Scored, best_of_places
from smad.diagnosis.simulator import Asked, Held
from smad.diagnosis.verdict import (
    CHANGED,
    CONTRADICTING,
    DIFFERS,
    PARAMETERS,
    PLACES,
    QUIET,
    PlaceTold,
    RunGap,
    SignalGap,
    Verdict,
    change_headline,
)

QUIET_FLOORS = 1.35
"""A gap to the simulator that is smaller, in floors, is none: floors are known to a third."""
APART = 0.6
"""A run is of another state when coefficients of its own take this share of it, above the floor."""
_APART_SETS = 8
"""Of the likeliest places, whose laws are asked whether a run needs one of its own."""
_NOTHING_NEW = "nothing is new beyond what good runs differ in"


@dataclass(frozen=True, kw_only=True)
class Answer:
    """A verdict with what it rests on, for figures and models; None where runs were refused.

    `rows` are those that the laws of `listed` were fitted to, `model` has all that is told.
    """

    verdict: Verdict
    listed: Listed | None = None
    rows: FoldRows | None = None
    model: ModelPoint | None = None


def answer_of_differs(asked: Asked, held: Held) -> Answer:
    """The list of what the simulator lacks."""
    v = _verdict(
        asked, DIFFERS, held.listed, rows=held.rows, run_of_row=held.gap.run_of_row,
        ranked=held.where.ranked,
    )  # fmt: skip
    assert v.whole is not None
    whole, odd = v.whole, [r.run for r in v.by_run if r.contradicts]
    if odd:
        outcome = CONTRADICTING
    elif v.places:
        outcome = PLACES
    else:
        outcome = QUIET if whole.raw < QUIET_FLOORS else PARAMETERS
    taken = (whole.raw**2 - whole.parameters**2) / max(whole.raw**2 - 1.0, 1e-9)
    v = msgspec.structs.replace(
        v,
        outcome=outcome,
        headline=_headline(outcome, v.places, whole, odd),
        parameters_take=float(np.clip(taken, 0.0, 1.0)),
    )
    return _with_models(asked, held.listed, held.rows, v)


def answer_of_changed(asked: Asked, found: Changed) -> Answer:
    """What is new since the good runs."""
    run_of_row = found.joint.run_of_row - len(asked.good)
    v = _verdict(
        asked, CHANGED, found.listed, rows=found.contrast.own, run_of_row=run_of_row,
        ranked=found.contrast.ranked,
    )  # fmt: skip
    odd = [r.run for r in v.by_run if r.contradicts]
    outcome, headline = found.outcome, change_headline(found.outcome, v.places, _NOTHING_NEW)
    if odd and outcome == PLACES:
        outcome = CONTRADICTING
        headline = (
            f"changed, but not alike in all runs: {_apart(odd)} of another state than the rest"
        )
    v = msgspec.structs.replace(
        v, outcome=outcome, headline=headline, parameters_take=max(found.parameters, 0.0)
    )
    return _with_models(asked, found.listed, found.rows, v)


def _verdict(
    asked: Asked,
    question: str,
    listing: Listed,
    *,
    rows: FoldRows,
    run_of_row: Index,
    ranked: Sequence[Scored],
) -> Verdict:
    """What both questions say alike."""
    plant, m = asked.plant, listing.settler.gap.measured
    raw = predictions(plant, listing.settler.start, m.played)
    stages = [
        [y - p for y, p in zip(m.values, stage, strict=True)] for stage in (raw, *listing.predicted)
    ]
    floors = [asked.floors] * len(m.played)
    budget = budget_of(plant.channels, stages, m.valid, floors, asked.judged)
    columns = [s.columns for s in best_of_places(ranked)[:_APART_SETS]]
    return Verdict(
        question=question,
        outcome="",
        headline="",
        places=_told(plant, listing),
        budget=budget.signals,
        whole=budget.whole,
        by_run=_by_run(asked, rows, run_of_row, columns, budget.by_run),
        ranked=place_shares(plant, ranked),
        unseen=unseen(plant, rows, ranked, WORTH_TELLING * rows.square),
    )


def _with_models(asked: Asked, listing: Listed, rows: FoldRows, verdict: Verdict) -> Answer:
    settler = listing.settler
    points = [settler.model(s) for s in listing.settled]
    uncertain = [settler.uncertainty(s) for s in listing.settled]
    said = msgspec.structs.replace(
        verdict,
        parameters=parameters_told(asked.plant, settler.start, points[-1], uncertain[-1]),
        judged_on=_judged_on(asked),
        models=_models(asked.plant, points, uncertain, verdict.headline),
    )
    return Answer(verdict=said, listed=listing, rows=rows, model=points[-1])


def _judged_on(asked: Asked) -> str:
    if asked.fit < len(asked.runs):
        held = len(asked.runs) - asked.fit
        return f"{held} run{'s'[: held > 1]} held out"
    if asked.fit == 1:
        return "stretches of the one run, each by a model of the others"
    return f"{asked.fit} runs, each by a model of the others"


def _told(plant: PlacesPlant, listing: Listed) -> list[PlaceTold]:
    """The places of the list with the coefficients that they have in the simulator."""
    n = len(plant.parameters)
    last, gap = listing.settled[-1], listing.settler.gap
    unit = listing.settler.uncertainty(last).covariance[n:, n:]
    found = listing.settler.found
    _, scale = found.coefficients(last.columns)
    covariance = unit / np.outer(scale, scale) if len(scale) else np.zeros((0, 0))
    own = Fits(last.columns, Fit(last.x[n:], covariance), ())
    teller = Teller(gap, found, own)
    return [
        teller.told(step, share, in_simulator=True)
        for step, share in zip(listing.steps, listing.shares, strict=True)
    ]


def _by_run(
    asked: Asked, rows: FoldRows, of_row: Index, columns: Sequence[Index], gaps: Array
) -> list[RunGap]:
    alone = asked.fit < 2
    out = []
    for k, run in enumerate(asked.runs):
        own = 0.0 if alone or k >= asked.fit else apart(rows, of_row, columns, k)
        out.append(
            RunGap(
                run=run.name, raw=float(gaps[0, k]), parameters=float(gaps[1, k]),
                final=float(gaps[-1, k]), apart=max(own, 0.0),
                contradicts=own >= APART and gaps[0, k] >= 1.0,
            )
        )  # fmt: skip
    return out


def _models(
    plant: PlacesPlant, points: Sequence[ModelPoint], uncertain: Sequence[Uncertainty], note: str
) -> list[str]:
    """The models as the plant writes them, as text; none for a plant that writes no files."""
    if not isinstance(plant, SavesModel):
        return []
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for k, (point, own) in enumerate(zip(points, uncertain, strict=True)):
            path = Path(folder) / f"model-{k}.toml"
            plant.save_model(point, path, note, own)
            out.append(path.read_text("utf-8"))
    return out


def _headline(
    outcome: str, places: Sequence[PlaceTold], whole: SignalGap, odd: Sequence[str]
) -> str:
    if outcome == CONTRADICTING:
        return f"no answer for all runs: {_apart(odd)} of another state than the rest"
    if outcome == QUIET:
        return "no gap beyond the floor: the simulator is as good as the readings"
    if outcome == PARAMETERS:
        return (
            f"other values of the parameters bring the gap from {whole.raw:.1f} to "
            f"{whole.parameters:.1f} floors; no place takes enough of the rest"
        )
    listing = ", ".join(p.words for p in places[:3]) + (" and more" if len(places) > 3 else "")
    return (
        f"the simulator lacks something at {len(places)} place{'s'[: len(places) > 1]}: {listing}; "
        f"the gap goes from {whole.raw:.1f} to {whole.final:.1f} floors"
    )


def _apart(odd: Sequence[str]) -> str:
    return f"{', '.join(odd)} {'is' if len(odd) == 1 else 'are'}"
