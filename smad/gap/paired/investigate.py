"""What to play next so that what a check-up leaves open is settled. Pure: verdicts in, runs out.

Every hypothesis that stays predicts how each run of the programme would differ from the good one.
The separation of two hypotheses by a run is the squared distance of their predictions in white
space, d²: what noise and days cannot imitate. 16 is four standard errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from smad.gap.paired.constants import Constants
from smad.gap.paired.difference import SHARE, Paired, rows_of
from smad.gap.paired.evidence import variance
from smad.gap.paired.model import Played, predictions
from smad.gap.paired.programme import Programme
from smad.gap.paired.reference import RunReference
from smad.gap.paired.verdict import (
    CAUSE,
    GROUP,
    PARAMETERS,
    QUIET,
    UNKNOWN,
    Likely,
    Verdict,
    first_names,
)
from smad.gap.paired.white import RunRows, Shrink
from smad.gap.plant import Array, ModelPoint

_WATER_DEGC = 27.0
MOST_REPEATS = 8


@dataclass(frozen=True)
class Offer:
    """A run with what playing it once more should bring.

    `separation` is d² of the hypotheses that stay, weighted over their pairs, `taken` what the
    likeliest takes of the run's sum of squares: its form is uncertain in proportion. `known` says
    that the baseline has the run, so that it is judged as a pair.
    """

    run: str
    separation: float
    taken: float = 0.0
    known: bool = True


@dataclass(frozen=True)
class Proposal:
    """What to do after a verdict: play `run`, or nothing more where it is None; `why` in words.

    `staying` names the hypotheses between which nothing is decided, `offers` the runs that might
    part them, best first.
    """

    run: str | None
    why: str
    staying: tuple[str, ...] = ()
    offers: tuple[Offer, ...] = ()

    @property
    def settled(self) -> bool:
        """Whether nothing is left to decide."""
        return self.run is None and not self.staying


@dataclass(frozen=True)
class _Odds:
    """Log odds of the first hypothesis against the second, as the verdict's rule has them.

    `lead` is the difference of their scores so far, `gain` what the first takes so far.
    """

    lead: float
    gain: float
    constants: Constants

    def after(self, offer: Offer, times: int) -> float:
        """What they should be once a run has been played so many times more."""
        lead = self.lead + times * offer.separation
        gain = self.gain + times * offer.taken
        return 0.5 * lead / variance(gain, self.constants)

    def most(self, offer: Offer, times: int) -> float:
        """The best that up to so many times would bring."""
        return max(self.after(offer, n) for n in range(1, times + 1))


_WITHOUT_A_NAME = (QUIET, PARAMETERS, UNKNOWN)
_SETTLED = {
    QUIET: "nothing has changed beyond the repeat floor",
    PARAMETERS: "other values of the parameters explain it",
    UNKNOWN: "nothing of the library explains it",
    CAUSE: "no other cause is within the odds",
}


def propose(
    paired: Paired,
    verdict: Verdict,
    constants: Constants,
    costs_s: Mapping[str, float],
    left_s: float,
) -> Proposal:
    """The run that best separates what stays, for its time; none when it is settled or of no use.

    `costs_s` is what playing each run takes, `left_s` the time that is left. A run is of use when
    playing it, several times if need be, should bring the odds to where the verdict names one.
    Where no entry is named, every run of the baseline is played once before that is the answer.
    """
    if verdict.outcome in _WITHOUT_A_NAME and (run := _next_new(paired, costs_s, left_s)):
        return Proposal(run, f"for the first time now: so far {_SETTLED[verdict.outcome]}")
    if verdict.outcome != GROUP:
        return Proposal(None, f"settled: {_SETTLED[verdict.outcome]}")
    staying = _staying(verdict)
    names = tuple(label(x) for x in staying)
    both = " and ".join(names)
    now = _odds(paired, staying, constants)
    offers = sorted(_offers(paired, staying), key=lambda o: -now.most(o, MOST_REPEATS))
    wanted = float(np.log(constants.odds))
    useful = [o for o in offers if now.most(o, MOST_REPEATS) >= wanted]
    if not useful:
        most = np.exp(now.most(offers[0], MOST_REPEATS))
        return Proposal(
            None,
            f"no run on offer separates {both}: {offers[0].run}, the best, should bring odds of "
            f"{most:.1f} to 1 however often it is played; {constants.odds:g} would name one",
            names,
            tuple(offers),
        )
    times = {o.run: int(left_s // costs_s[o.run]) for o in useful}
    affordable = [o for o in useful if times[o.run]]
    if not affordable:
        return Proposal(
            None,
            f"the time is spent: {useful[0].run} would separate {both} by "
            f"d² = {useful[0].separation:.0f}, and takes {costs_s[useful[0].run] / 60:.1f} min of "
            f"{max(left_s, 0.0) / 60:.1f} left",
            names,
            tuple(offers),
        )
    best = max(affordable, key=lambda o: (now.after(o, 1) - now.after(o, 0)) / costs_s[o.run])
    return Proposal(
        best.run,
        f"again: it separates {both} best, by d² = {best.separation:.0f}, and should "
        f"bring odds of {np.exp(min(now.after(best, 1), 30.0)):.3g} to 1",
        names,
        tuple(offers),
    )


def _next_new(paired: Paired, costs_s: Mapping[str, float], left_s: float) -> str | None:
    """The first run of the baseline that was not repeated yet, and for which there is time."""
    done = {pair.reference.name for pair in paired.pairs}
    names = [r.name for r in paired.reference.runs if r.name not in done]
    return next((name for name in names if costs_s[name] <= left_s), None)


def _staying(verdict: Verdict) -> list[Likely]:
    return [x for x in first_names(verdict.likely) if x.names[0] in verdict.group]


def _odds(paired: Paired, staying: Sequence[Likely], constants: Constants) -> _Odds:
    first, second = staying[0], staying[1]
    change = paired.white_change(first.values) if first.values else None
    z = paired.z
    gain = 0.0 if change is None else float(z @ z - (z - change) @ (z - change))
    ratio = max(first.probability, 1e-12) / max(second.probability, 1e-12)
    return _Odds(2.0 * float(np.log(ratio)) * variance(gain, constants), gain, constants)


def label(x: Likely) -> str:
    """A hypothesis in words."""
    return " + ".join(x.names)


def _offers(paired: Paired, staying: Sequence[Likely]) -> list[Offer]:
    weights = [x.probability for x in staying]
    theta = _parameters(paired)
    out = []
    for run in paired.reference.runs:
        changes = [_change(paired, run.played, run, x, theta)
                   for x in staying]  # fmt: skip
        rows = rows_of(paired.plant, paired.traits, paired.reference, run, run.valid)
        slopes = rows.shrink(rows.independent(run.slopes))
        out.append(Offer(run.name, *_separation(changes, weights, rows, SHARE * slopes)))
    return out


def unpaired_offers(paired: Paired, verdict: Verdict, programme: Programme) -> list[Offer]:
    """Runs of the programme that the baseline lacks, as far as the model can say; best first.

    Without a good recording the model's own form error stays in, so this is more than they bring.
    """
    staying = _staying(verdict)
    known = {r.name for r in paired.reference.runs}
    theta = _parameters(paired)
    floor = paired.reference.floor
    sd = (floor.gauge * floor.sd.max(axis=1)) * np.sqrt(2.0)
    out = []
    for run in programme.runs:
        if run.name in known:
            continue
        played = Played.of(run.as_run(_WATER_DEGC, _WATER_DEGC))
        changes = [_change(paired, played, None, x, theta)
                   for x in staying]  # fmt: skip
        shape = next((c.shape for c in changes if c is not None), None)
        if shape is None:
            continue
        rows = RunRows(
            np.broadcast_to(sd, shape), np.ones(shape, dtype=bool), np.zeros((0, *shape)),
            np.zeros(0), floor.rho,
        )  # fmt: skip
        none = np.zeros((0, shape[0] * shape[1]))
        out.append(Offer(run.name, *_separation(changes, [x.probability for x in staying], rows,
                                               none), known=False))  # fmt: skip
    return sorted(out, key=lambda o: -o.separation)


def _parameters(paired: Paired) -> Array:
    """The most likely move of the parameters alone, in their prior's standard deviations."""
    J, z = paired.slopes, paired.untied
    return np.asarray(np.linalg.solve(J @ J.T + np.eye(len(J)), J @ z))


def _change(
    paired: Paired,
    played: Played,
    run: RunReference | None,
    x: Likely,
    theta: Array,
) -> Array | None:
    """What a hypothesis changes of a run; None where the model cannot say."""
    plant, reference = paired.plant, paired.reference
    if x.names == [PARAMETERS]:
        if run is not None:
            return np.asarray(np.tensordot(theta, run.slopes, axes=1))
        moved = {
            q.name: float(np.clip(reference.point.theta.get(q.name, q.nominal) + q.prior_sd * t,
                                  q.low, q.high))
            for q, t in zip(plant.parameters, theta, strict=True)
        }  # fmt: skip
        point = ModelPoint(moved, reference.point.effects)
    else:
        point = ModelPoint(reference.point.theta, {**reference.point.effects, **x.values})
    base = run.base if run is not None else predictions(plant, reference.point, [played])[0]
    found = predictions(plant, point, [played])[0]
    return found - base if np.isfinite(found).all() and np.isfinite(base).all() else None


def _separation(
    changes: Sequence[Array | None], weights: Sequence[float], rows: RunRows, slopes: Array
) -> tuple[float, float]:
    """d² of the hypotheses, weighted over pairs, and what the first takes."""
    tie = Shrink(slopes)
    white = [None if c is None else tie(rows.shrink(rows.independent(c[None])))[0] for c in changes]
    total, weight = 0.0, 0.0
    for (a, wa), (b, wb) in combinations(zip(white, weights, strict=True), 2):
        if a is not None and b is not None:
            total += wa * wb * float((a - b) @ (a - b))
            weight += wa * wb
    first = white[0]
    taken = 0.0 if first is None else float(first @ first)
    return (total / weight if weight > 0.0 else 0.0), taken
