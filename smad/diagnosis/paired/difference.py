"""The paired residual: (measured now − predicted now) − (measured then − predicted then).

Notes say what was compared, with which model, and what weakens the comparison.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.data.rows import (
    binned,
    offset_s,
    require_like_inputs,
    same_inputs,
    without_other_end,
)
from smad.diagnosis.errors import TooLittleRecorded
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.paired.good import GoodRun, GoodRuns, day_directions
from smad.diagnosis.paired.start import directions, distances
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Array, Effect, Mask, PlantModel, traits_of
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence, Trial, drift_directions
from smad.diagnosis.rivals.rival import Question, day_variance, question_of
from smad.diagnosis.runs import GapRun
from smad.progress import Say

Known = TypeVar("Known", Responses, Changes)


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A run of now, by its `name`, and the good run that it repeats, `then`.

    `share` is how much of the good run it has recorded. `carried`: the inputs differed, and the
    model carried the difference over. The `trial` replays the inputs of then (its own where
    carried) in the surroundings of now; its target is that prediction plus the change of the bench.
    `around` are these surroundings, and `away` how far from the good run it starts, by channel.
    """

    name: str
    then: GoodRun
    trial: Trial
    share: float
    carried: bool
    around: Mapping[str, float]
    away: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class PairedRuns:
    """Pairs with the good runs that they are of."""

    plant: PlacesPlant
    good: GoodRuns
    pairs: tuple[Pair, ...]

    def evidence(self) -> Evidence:
        """The pairs as rows."""
        trials = tuple(p.trial for p in self.pairs)
        return Evidence(trials=trials, least_square=0.0 if self.good.floor.degrees else 1.0)

    def repeated(self, known: Known | None) -> Known | None:
        """Responses or changes of the good runs for these pairs; None if inputs were carried."""
        if known is None or any(p.carried for p in self.pairs):
            return None
        of_run = {r.name: x for r, x in zip(self.good.runs, known.runs, strict=True)}
        return replace(known, runs=tuple(of_run[p.then.name] for p in self.pairs))


def pair_runs(plant: PlacesPlant, good: GoodRuns, runs: Sequence[tuple[GapRun, str]]) -> PairedRuns:
    """Pairs of `runs`, each with the name of the good run that it repeats.

    Raises PairingError for inputs that differ too much, and TooLittleRecorded for pairs that in all
    have fewer rows than count as one.
    """
    by_name = {r.name: r for r in good.runs}
    pairs = tuple(_pair(plant, good, run, by_name[name]) for run, name in runs)
    rows = sum(int(p.trial.rows.valid.any(axis=1).sum()) for p in pairs)
    if rows < CORRELATED:
        raise TooLittleRecorded(
            "too little was recorded both then and now to judge",
            value=f"{rows} rows of {good.runs[0].played.period_s:g} s",
            limit=f"{CORRELATED:.0f} or more",
            action="play the runs again to their end",
        )
    return PairedRuns(plant=plant, good=good, pairs=pairs)


def question_of_pairs(pairs: PairedRuns, effects: Sequence[Effect], say: Say) -> Question:
    """What is new in pairs, with the parameters tied to the good runs within a day's variation.

    Responses and changes of the good runs are used again, though the surroundings differ.
    """
    plant, good = pairs.plant, pairs.good
    covariance = np.diag(day_variance(plant)) + good.parameter_covariance(plant)
    return question_of(
        plant,
        good.point,
        pairs.evidence(),
        effects=effects,
        say=say,
        tied=np.asarray(np.linalg.inv(covariance)),
        responses=pairs.repeated(good.responses),
        changes=pairs.repeated(good.changes),
    )


def _pair(plant: PlacesPlant, good: GoodRuns, run: GapRun, then: GoodRun) -> Pair:
    start = then.played.start_s + offset_s(run, then.played.whole)
    now = binned(run, then.played.bins, plant, start, then.played.period_s)
    now = without_other_end(now, then.inputs)
    require_like_inputs(now, then.inputs)
    around = run.at_start(traits_of(plant).environment.values())
    other = not same_inputs(now, then.inputs)
    again = _again(then, run, other, around, start)
    (predicted,) = predictions(plant, good.point, [again], exact=True)
    moved = np.where(np.isfinite(predicted) & now.covered[:, None], predicted - then.base, 0.0)
    valid = now.valid & then.valid & now.covered[:, None]
    rows = rows_of(plant, good, then, valid, moved)
    change = now.values - then.mean - moved
    away = distances(plant, then.played.run.starts, change, rows, then.played.period_s)
    rows = rows.with_days(directions(plant, good.point, again, predicted, away))
    again = then.as_measured(plant, again)
    (predicted,) = predictions(plant, good.point, [again], exact=True)
    # In the surroundings of now, since a change may act differently there.
    target = predicted + (now.values - then.mean) - moved
    if not good.floor.degrees:
        # Without repeats nothing has shown how far the room drifts.
        rows = rows.with_days(drift_directions(plant, good.point, again))
    return Pair(
        name=run.name,
        then=then,
        trial=Trial(played=again, target=target, rows=rows),
        share=now.share,
        carried=other,
        around=around,
        away=away,
    )


def rows_of(plant: PlantModel, good: GoodRuns, then: GoodRun, valid: Mask, moved: Array) -> RunRows:
    """Whitening of one more recording of a run, `valid` where it has readings.

    `moved` (bins, channels) is what the model carried over.
    """
    day = day_directions(plant, then.slopes, then.base, moved, then.played.period_s)
    inflate = np.sqrt(1.0 + 1.0 / np.maximum(then.count, 1))
    return RunRows(
        sd=good.floor.of(then.regime, day) * inflate,
        valid=valid,
        day=day,
        day_sd=good.floor.day_sd * float(inflate.mean()),
        rho=good.floor.rho,
    )


def _again(
    then: GoodRun, run: GapRun, other: bool, around: Mapping[str, float], start_s: float
) -> Played:
    """The good run in the surroundings `around`, with the inputs of `run` if they differ."""
    source = run if other else then.played.whole
    levels = {c: np.full(len(source.t_s), around.get(c, value)) for c, value in then.around.items()}
    starts = then.played.run.starts
    again = GapRun(run.name, source.t_s, source.inputs, levels, starts=starts)
    begin_s = start_s if other else then.played.start_s
    played = Played.of(again, then.played.inputs, begin_s, then.played.period_s)
    return replace(played, bins=then.played.bins)


def compared(paired: PairedRuns) -> str:
    """Which runs were compared with which good ones."""
    then = {p.name: _recordings(p.then) for p in paired.pairs}
    named = ", ".join(f"{now} with {good}" for now, good in then.items())
    return f"runs of the same inputs were compared: {named}"


def notes_of(paired: PairedRuns) -> list[str]:
    """What the model of the good runs has, and facts that weaken the comparison."""
    out = []
    if effects := paired.good.point.effects:
        out.append(f"the model has what the good runs show: {', '.join(effects)}")
    if not paired.good.floor.degrees:
        out.append(
            "each run was recorded good only once: the repeat floor is a guess; record one again "
            "on another day"
        )
    for p in paired.pairs:
        if p.share < 0.98:
            out.append(
                f"{p.name} counts as far as it goes: {100 * p.share:.0f} % of it was recorded"
            )
        if p.carried:
            out.append(
                f"{p.name}: inputs differed from the good run's; the model carried that over"
            )
    if lost := _lost(paired):
        out.append(f"recorded then and not now, and left out: {lost}")
    warm = [
        f"{c} {p.around[c] - p.then.around[c]:+.1f} K in {p.name}"
        for p in paired.pairs
        for c in p.around
        if c in p.then.around and abs(p.around[c] - p.then.around[c]) > 1.0
    ]
    if warm:
        out.append("carried over by the model: " + ", ".join(warm))
    unit = {channel.name: channel.unit for channel in paired.plant.channels}
    out += [
        f"{p.name} began elsewhere than its good run ({channel} {distance:+.2g} {unit[channel]}), "
        "as runs before may have left it: that counts as a difference between days"
        for p in paired.pairs
        for channel, distance in p.away.items()
    ]
    return out


def _recordings(then: GoodRun) -> str:
    more = int(then.count.max(initial=1)) - 1
    return f"{then.name} and {more} more" if more > 0 else then.name


def _lost(paired: PairedRuns) -> str:
    """Channels that lack most of the readings that the good runs have, with the runs."""
    runs: dict[str, list[str]] = {}
    for p in paired.pairs:
        had, has = p.then.valid.sum(axis=0), p.trial.rows.valid.sum(axis=0)
        for c, then, now in zip(paired.plant.channels, p.share * had, has, strict=True):
            if now < 0.5 * then:
                runs.setdefault(c.name, []).append(p.name)
    return ", ".join(f"{channel} ({', '.join(names)})" for channel, names in runs.items())
