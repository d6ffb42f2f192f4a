"""Which run to play next to separate the rivals that a check-up leaves. Pure: no bench, no clock.

The separation of two rivals by a run is d², the squared distance of their predicted rows over the
variance of a row. 16 is four standard errors if whitened rows are independent; the score counts
sixteen rows as one, so that it may stay undecided after such a run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from smad.checkup.judge import Judgement
from smad.checkup.programme import Programme
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.next_run import separation
from smad.diagnosis.numerics.white import RunRows, shrinking
from smad.diagnosis.paired.difference import PairedRuns, rows_of
from smad.diagnosis.paired.good import GoodRun
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.describe import rival_words
from smad.diagnosis.rivals.rival import day_variance
from smad.diagnosis.verdict import PARAMETERS, QUIET

SEPARATED = 16.0
"""Least d² that separates two rivals: four standard errors."""
ALL_PLAYED = "every run of the baseline was played"
ONE_LEFT = "one rival is left"
"""Beginnings of the reason for which nothing more is played."""
_WATER_DEGC = 27.0


@dataclass(frozen=True)
class Proposal:
    """What to do after a verdict: play `run`, or nothing more if it is None; `why` in words.

    `staying` names the remaining rivals. `offers` are the runs that may separate them, with the
    least d² of any two, the largest first.
    """

    run: str | None
    why: str
    staying: tuple[str, ...] = ()
    offers: Mapping[str, float] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """What to play and why, and what each run would separate."""
        lines = [f"{self.run} {self.why}" if self.run else self.why]
        lines += [f"  {run:<10} d² = {d2:.1f}" for run, d2 in self.offers.items()]
        if self.run is not None:
            lines.append("smad gap investigate plays it, and goes on until one rival is left")
        return lines


def propose(judgement: Judgement, costs_s: Mapping[str, float], left_s: float) -> Proposal:
    """The run that best separates the remaining rivals for its time; none if one is left, or no run
    would help.

    `costs_s` is the time for each run, `left_s` the time that is left. Each run is played once,
    since a repeat separates no rivals that the first play did not. Without a cause every run of the
    baseline is played before that is the answer.
    """
    verdict, pairs = judgement.verdict, judgement.pairs
    if not verdict.causes:
        finding = {
            QUIET: "nothing has changed beyond the repeat floor",
            PARAMETERS: "other values of the parameters explain it, or an effect that they imitate",
        }.get(verdict.outcome, "no cause was found")
        new = [r.name for r in _not_played(pairs)]
        if run := next((name for name in new if costs_s[name] <= left_s), None):
            return Proposal(run, f"for the first time now: so far {finding}")
        if new:
            unplayed = ", ".join(new)
            return Proposal(None, f"the time is spent: so far {finding}; not played: {unplayed}")
        return Proposal(None, f"{ALL_PLAYED}: {finding}")
    staying = judgement.alternatives
    names = tuple(rival_words(pairs.plant, r) for r in staying)
    if len(staying) < 2:
        left = verdict.causes[0]
        why = f"{ONE_LEFT}: {left.words}, probability {left.probability:.2f}; no other is near"
        return Proposal(None, why)
    either = " or ".join(names)
    offers = _offers(judgement)
    if not offers:
        why = f"{ALL_PLAYED}, and {either} is left open"
        return Proposal(None, why, names)
    first, largest = next(iter(offers.items()))
    affordable = [run for run, d2 in offers.items() if d2 >= SEPARATED and costs_s[run] <= left_s]
    best = max(affordable, key=lambda run: offers[run] / costs_s[run], default=None)
    if best is not None:
        why = f"it separates {either} best for its time, by d² = {offers[best]:.0f}"
    elif largest < SEPARATED:
        why = (
            f"no remaining run separates {either}: {first}, the best, does so by "
            f"d² = {largest:.1f}; {SEPARATED:g} is needed"
        )
    else:
        why = (
            f"the time is spent: {first} would separate {either} by d² = {largest:.0f}, "
            f"and takes {costs_s[first] / 60:.1f} min of {max(left_s, 0.0) / 60:.1f} left"
        )
    return Proposal(best, why, names, offers)


def _not_played(paired: PairedRuns) -> list[GoodRun]:
    """Runs of the baseline that no pair repeats."""
    done = {pair.then.name for pair in paired.pairs}
    return [run for run in paired.good.runs if run.name not in done]


def _offers(judgement: Judgement) -> dict[str, float]:
    """Runs of the baseline that were not played yet with their d², the largest first."""
    pairs = judgement.pairs
    sd = np.sqrt(day_variance(pairs.plant))
    out = {}
    for run in _not_played(pairs):
        rows = rows_of(pairs.plant, pairs.good, run, run.valid, np.zeros(run.base.shape))
        slopes = rows.shrink(rows.independent(sd[:, None, None] * run.slopes))
        # As a pair of it would be judged: its sensors are given what was measured.
        played = run.as_measured(pairs.plant)
        out[run.name] = _separation(judgement, played, rows, slopes)
    return _largest_first(out)


def unpaired_offers(judgement: Judgement, programme: Programme) -> dict[str, float]:
    """Runs of the programme that the baseline lacks with their modelled d², the largest first.

    Without a good recording model error does not cancel, so this is an upper bound.
    """
    good = judgement.pairs.good
    paired_names, floor = good.names, good.floor
    sd = (floor.gauge * floor.sd.max(axis=1)) * np.sqrt(2.0)
    out = {}
    for run in programme.runs:
        if run.name not in paired_names:
            played = Played.of(run.as_run(_WATER_DEGC, _WATER_DEGC), judgement.pairs.plant.inputs)
            valid = np.ones((played.bins, len(sd)), dtype=bool)
            rows = RunRows.of(sd, valid, rho=floor.rho)
            out[run.name] = _separation(judgement, played, rows, np.zeros((0, valid.size)))
    return _largest_first(out)


def _largest_first(separations: Mapping[str, float]) -> dict[str, float]:
    return dict(sorted(separations.items(), key=lambda item: -item[1]))


def _separation(judgement: Judgement, played: Played, rows: RunRows, slopes: Array) -> float:
    """The least d² of the remaining rivals in the `rows` of a run, `slopes` (k, n) marginalised.

    The variance of a row is that of the residual with all causes, at least 1.
    """
    search = judgement.search
    assert search is not None
    variance = max(search.question.gap(search.final) ** 2, 1.0)
    plant, point, tie = judgement.pairs.plant, judgement.pairs.good.point, shrinking(slopes)
    (base,) = predictions(plant, point, [played])
    moves = []
    for rival in judgement.alternatives:
        (moved,) = predictions(plant, rival.fitted.point, [played])
        moves.append(tie(rows.shrink(rows.independent((moved - base)[None])))[0])
    return separation(moves) / variance
