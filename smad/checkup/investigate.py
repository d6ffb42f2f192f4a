"""What to play next so that what a check-up leaves open is settled. Pure: a check-up in, runs out.

Places that these runs do not tell apart each have a law. What the simulator makes of a run with one
law and with another is their separation by that run: d², the squared distance in white space, over
the variance of a row. 16 is four standard errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.checkup.judge import Judged
from smad.checkup.paired.difference import SHARE, Paired, rows_of
from smad.checkup.programme import Programme
from smad.diagnosis.constants import Constants
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.next_run import separation
from smad.diagnosis.numerics.white import RunRows, Shrink
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.search.locate import Alternative
from smad.diagnosis.verdict import PARAMETERS, QUIET

_WATER_DEGC = 27.0


@dataclass(frozen=True)
class Offer:
    """A run with d² of the laws that stay: the least over their pairs.

    `known` says that the baseline has the run, so that it is judged as a pair.
    """

    run: str
    separation: float
    known: bool = True


@dataclass(frozen=True)
class Proposal:
    """What to do after a verdict: play `run`, or nothing more where it is None; `why` in words.

    `staying` names the places between which nothing is decided, `offers` the runs that might part
    them, best first.
    """

    run: str | None
    why: str
    staying: tuple[str, ...] = ()
    offers: tuple[Offer, ...] = ()

    @property
    def settled(self) -> bool:
        """Whether nothing is left to decide."""
        return self.run is None and not self.staying


def propose(
    found: Judged, constants: Constants, costs_s: Mapping[str, float], left_s: float
) -> Proposal:
    """The run that best separates what stays, for its time; none when it is settled or of no use.

    `costs_s` is what playing each run takes, `left_s` the time that is left. Where no place is
    told, every run of the baseline is played once before that is the answer.
    """
    verdict, pairs = found.verdict, found.pairs
    if not verdict.places:
        said = {QUIET: "nothing has changed beyond the repeat floor",
                PARAMETERS: "other values of the parameters explain it"}.get(
                    verdict.outcome, "no place is told")  # fmt: skip
        if run := _next_new(pairs, costs_s, left_s):
            return Proposal(run, f"for the first time now: so far {said}")
        return Proposal(None, f"settled: {said}")
    staying = found.alternatives
    if len(staying) < 2:
        return Proposal(None, f"settled: {verdict.places[0].words}; no other place is near")
    names = tuple(x.words for x in staying)
    either = " or ".join(names)
    offers = sorted(_offers(found, staying), key=lambda o: -o.separation)
    useful = [o for o in offers if o.separation >= constants.separation]
    if not useful:
        most = offers[0]
        return Proposal(
            None,
            f"no run on offer tells {either}: {most.run}, the best, separates them by "
            f"d² = {most.separation:.1f}; {constants.separation:g} would be wanted",
            names,
            tuple(offers),
        )
    affordable = [o for o in useful if costs_s[o.run] <= left_s]
    if not affordable:
        return Proposal(
            None,
            f"the time is spent: {useful[0].run} would tell {either} by "
            f"d² = {useful[0].separation:.0f}, and takes {costs_s[useful[0].run] / 60:.1f} min of "
            f"{max(left_s, 0.0) / 60:.1f} left",
            names,
            tuple(offers),
        )
    best = max(affordable, key=lambda o: o.separation / costs_s[o.run])
    return Proposal(
        best.run,
        f"it separates {either} best for its time, by d² = {best.separation:.0f}",
        names,
        tuple(offers),
    )


def _next_new(paired: Paired, costs_s: Mapping[str, float], left_s: float) -> str | None:
    """The first run of the baseline that was not repeated yet, and for which there is time."""
    done = {pair.reference.name for pair in paired.pairs}
    names = [r.name for r in paired.reference.runs if r.name not in done]
    return next((name for name in names if costs_s[name] <= left_s), None)


def _offers(found: Judged, staying: Sequence[Alternative]) -> list[Offer]:
    """Runs of the baseline that were not played as often as the others, with their separation."""
    pairs = found.pairs
    times = [sum(p.reference.name == r.name for p in pairs.pairs) for r in pairs.reference.runs]
    out = []
    for run, played in zip(pairs.reference.runs, times, strict=True):
        if played > min(times):
            continue
        changes = [_change(pairs, run.played, x) for x in staying]
        rows = rows_of(pairs.plant, pairs.reference, run, run.valid)
        slopes = rows.shrink(rows.independent(run.slopes))
        d2 = _separation(changes, rows, SHARE * slopes)
        out.append(Offer(run.name, d2 / found.variance))
    return out


def unpaired_offers(found: Judged, programme: Programme) -> list[Offer]:
    """Runs of the programme that the baseline lacks, as far as the model can say; best first.

    Without a good recording the model's own form error stays in, so this is more than they bring.
    """
    pairs = found.pairs
    known = {r.name for r in pairs.reference.runs}
    floor = pairs.reference.floor
    sd = (floor.gauge * floor.sd.max(axis=1)) * np.sqrt(2.0)
    out = []
    for run in programme.runs:
        if run.name in known:
            continue
        played = Played.of(run.as_run(_WATER_DEGC, _WATER_DEGC))
        changes = [_change(pairs, played, x) for x in found.alternatives]
        shape = (played.bins, len(sd))
        rows = RunRows(
            np.broadcast_to(sd, shape), np.ones(shape, dtype=bool), np.zeros((0, *shape)),
            np.zeros(0), floor.rho,
        )  # fmt: skip
        d2 = _separation(changes, rows, np.zeros((0, shape[0] * shape[1])))
        out.append(Offer(run.name, d2 / found.variance, known=False))
    return sorted(out, key=lambda o: -o.separation)


def _change(pairs: Paired, played: Played, x: Alternative) -> Array:
    """What the law of a place changes of a run; no numbers where the model cannot say."""
    point = pairs.reference.point
    model = ModelPoint(point.theta, point.effects, x.laws)
    (moved,), (base,) = (predictions(pairs.plant, own, [played]) for own in (model, point))
    return moved - base


def _separation(changes: Sequence[Array], rows: RunRows, slopes: Array) -> float:
    """The least d² over pairs of changes, in white rows."""
    tie = Shrink(slopes)
    return separation([tie(rows.shrink(rows.independent(c[None])))[0] for c in changes])
