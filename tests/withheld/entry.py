"""How one entry of the library fares on a case by itself, in numbers.

Where a diagnosis did not give an entry's name, these say how far the entry would have come alone:
what it changes, how much of that the parameters can imitate, what it gains, and how far it is from
nothing, from a free refit, and from another entry.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from smad.gap.compare.assess import counted_share
from smad.gap.compare.nextexp import propose
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track, follow_tracks
from smad.gap.compare.verdict import decide, p_unknown
from smad.gap.compare.weigh import weigh
from smad.gap.errors import PlantMismatch
from smad.gap.fit.hypothesis import Hypothesis, acceptable, asked_gain
from smad.gap.fit.stages import Prepared
from smad.gap.fit.threads import repeatable
from smad.gap.plant import Array, Effect, catalogue_of
from smad.gap.records import Outcome
from tests.withheld.separations import confusability, separation

MOST_ODDS = 1e6


class Standing(msgspec.Struct, frozen=True):
    """How the diagnosis stands with nothing but the entry in its library.

    `outcome` is its answer, `outcome_asked` the one it would give if the free refit did not stand
    in its place; `unknown` the probability that the cause is another than the best model says.
    Gaps are G over the floor on held-out runs: of the good model, of the refit beside which the
    entry is sought, of the free refit; `threshold` is what is significant, `ceiling` the shrink
    that a flexible correction reaches. `free_gain` is how much better the free refit predicts than
    the best model asked for, `free_answers` whether it stood in its place.
    """

    outcome: Outcome
    outcome_asked: Outcome
    unknown: float
    gap_raw: float
    gap_refit: float
    gap_free: float
    threshold: float
    ceiling: float
    tied: bool
    free_answers: bool
    free_gain: float
    free_gain_se: float


class Fit(msgspec.Struct, frozen=True):
    """An entry's joint fit with the parameters.

    `size_floors` and `size_background` are the RMS of what the fitted effect changes, over the
    sensors' floor and over what the model is trusted to since the good runs, in the output where
    it is largest (`output`, that of the latter). `d2_known` is its separation from the same model
    without it, no parameter moved; `d2_nothing` that from the refit, `d2_free` that from the free
    refit. `asked` are the standard errors that the gain must exceed; the other numbers are those
    of `select.Candidate`. `shows` says whether they suffice, `enters` whether the entry came in,
    which one that the good runs ask for just as well does not.
    """

    values: dict[str, float]
    output: str
    size_floors: float
    size_background: float
    d2_known: float
    d2_nothing: float
    d2_free: float
    gain: float
    gain_se: float
    asked: float
    excess_before: float
    regime_gain: float
    shows: bool
    enters: bool


class Apart(msgspec.Struct, frozen=True):
    """An experiment of the catalogue that would tell two models apart, and by how much.

    `d2` is the separation that the models predict of that run alone, each adapting its parameters
    as far as the runs so far allow (`nextexp.Trial`), `counted` what of it can be counted on
    (`assess.counted_share`).
    """

    experiment: str
    d2: float
    counted: float


class Rival(msgspec.Struct, frozen=True):
    """Another entry in the entry's place.

    `d2` is the smaller of the two separations, each fitted to look like the other; `odds` are those
    of the rival against the entry, both None where the entry was not among the better fits; `apart`
    are the experiments that would best tell them apart.
    """

    name: str
    d2: float | None
    odds: float | None
    gain: float
    apart: list[Apart] = []


class EntryRecord(msgspec.Struct, frozen=True):
    """Everything about one entry; `fit` is None where no fit came to its end.

    `screen_gain` is what the screening gains by it; the short list has none that gain nothing, but
    here the entry is fitted even so. `masked` is the share of a typical effect's signature that the
    refitted parameters imitate, `visible` what is left of it, in floors (see `screen.Screened`).
    `background` is the RMS of what each channel is trusted to, in the channel's unit. `apart` are
    the experiments that would best tell the fitted entry from the refit without it.
    """

    name: str
    screen_gain: float
    masked: float
    visible: float
    background: dict[str, float]
    standing: Standing
    fit: Fit | None
    rivals: list[Rival]
    apart: list[Apart] = []

    @property
    def hidden(self) -> float:
        """Share of the fitted effect that the refit beside it can imitate; of a typical one if
        none was fitted."""
        if self.fit is None or self.fit.d2_known <= 0.0:
            return self.masked
        return float(np.clip(1.0 - self.fit.d2_nothing / self.fit.d2_known, 0.0, 1.0))


@repeatable
def examine(
    prepared: Prepared,
    names: Sequence[str],
    others: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> EntryRecord:
    """The best of the entries `names` (one cause may have several) alone, and beside `others`.

    Asks for one effect, so that the settings should allow for no more. `others` are then asked for
    together with the entries, from the same refits.
    """
    library = {e.name: e for e in prepared.plant.effects}
    own = [library[n] for n in names if any(p.strength for p in library[n].parameters)]
    if not own:
        raise PlantMismatch(
            "the entry has no strength that could be looked for",
            value=", ".join(names),
            action="ask for an effect with a strength",
        )
    track = follow_tracks(prepared, own, progress, unscreened=[e.name for e in own])
    best = _best(track.asked, names)
    shown = best.names[0] if best is not None else track.asked.screened[0].effect.name
    seen = next(s for s in track.asked.screened if s.effect.name == shown)
    return EntryRecord(
        name=shown,
        screen_gain=seen.gain,
        masked=seen.masked,
        visible=seen.size,
        background=_background(prepared),
        standing=_standing(prepared, track),
        fit=None if best is None else _fit(prepared, track.asked, best),
        rivals=_rivals(prepared, own, [library[n] for n in others], progress),
        apart=[] if best is None else _apart(prepared, best, track.asked.base),
    )


def _apart(prepared: Prepared, one: Hypothesis, other: Hypothesis) -> list[Apart]:
    found = propose(
        [one.fit, other.fit],
        [0.5, 0.5],
        prepared.noise,
        catalogue_of(prepared.plant),
        share=counted_share(one, other),
    )
    return [Apart(q.name, q.separation, q.counted or 0.0) for q in found]


def _best(selection: Selection, names: Sequence[str]) -> Hypothesis | None:
    """The best single model of these effects that was fitted."""
    mine = [c for c in selection.tried if len(c.names) == 1 and c.names[0] in names]
    return max(mine, key=lambda c: c.gain, default=None)


def _standing(prepared: Prepared, track: Track) -> Standing:
    asked = replace(track, selection=track.asked, tied=prepared.tied is not None)
    numbers = weigh(prepared, asked)
    outcome_asked, _ = decide(numbers, prepared.settings)
    stood = track.selection is not track.asked
    outcome = decide(weigh(prepared, track), prepared.settings)[0] if stood else outcome_asked
    return Standing(
        outcome=outcome,
        outcome_asked=outcome_asked,
        unknown=p_unknown(numbers, prepared.settings),
        gap_raw=numbers.gap_raw,
        gap_refit=numbers.whole.gap_refit,
        gap_free=numbers.gap_free,
        threshold=prepared.threshold,
        ceiling=numbers.whole.ceiling,
        tied=asked.tied,
        free_answers=stood,
        free_gain=track.free_gain,
        free_gain_se=track.free_gain_se,
    )


def _fit(prepared: Prepared, selection: Selection, c: Hypothesis) -> Fit:
    problem, settings = c.fit.problem, prepared.settings
    tied = prepared.tied is not None
    less = problem.dataset.predict([c.fit.without(c.names[0])])[0]
    change = c.fit.predicted - less
    floors = _by_output(prepared, change / _floor_of_rows(prepared))
    background = _by_output(prepared, problem.whitening.scale(change))
    output = max(background, key=lambda k: background[k])
    known = separation(c.fit, problem.white(less))
    d2 = confusability([c.fit, selection.base.fit, prepared.fit])[0]
    # The refits end somewhat apart from the joint fit even where the entry is fitted to nothing.
    # Parameters that stay where they are bound the distance of those that may follow.
    nothing = min(known, float(d2[1]))
    return Fit(
        values=dict(c.fit.point.effects[c.names[0]]),
        output=output,
        size_floors=max(floors.values()),
        size_background=background[output],
        d2_known=known,
        d2_nothing=nothing,
        d2_free=min(nothing, float(d2[2])),
        gain=c.gain,
        gain_se=c.gain_se,
        asked=asked_gain(c, settings, tied=tied) / max(c.gain_se, 1e-9),
        excess_before=c.excess_before,
        regime_gain=c.regime_gain,
        shows=acceptable(c, settings, tied=tied),
        enters=any(step.names == c.names for step in selection.steps),
    )


def _rivals(
    prepared: Prepared,
    own: Sequence[Effect],
    others: Sequence[Effect],
    progress: Callable[[str], None],
) -> list[Rival]:
    """The other entries, nearest first."""
    if not others:
        return []
    everyone = [*own, *others]
    names = [e.name for e in everyone]
    asked = follow_tracks(prepared, everyone, progress, unscreened=names).asked
    best = _best(asked, [e.name for e in own])
    table = next(iter(asked.probability.values()), {})
    p_own = 0.0 if best is None else table.get(best.names[0], 0.0)
    out = []
    for effect in others:
        rival = _best(asked, [effect.name])
        if rival is None:
            continue
        d2 = odds = None
        apart: list[Apart] = []
        if best is not None:
            both = confusability([best.fit, rival.fit])
            d2 = float(min(both[0, 1], both[1, 0]))
            odds = table.get(effect.name, 0.0) / max(p_own, 1.0 / MOST_ODDS)
            apart = _apart(prepared, best, rival)
        out.append(Rival(effect.name, d2, odds, rival.gain, apart))
    return sorted(out, key=lambda r: (r.d2 is None, r.d2 or 0.0, r.name))


def _by_output(prepared: Prepared, rows: Array) -> dict[str, float]:
    """RMS of the valid rows of each output."""
    ev = prepared.problem.dataset
    out = {}
    for key in ev.keys:
        own = ev.valid_rows(key, rows)
        out[key] = float(np.sqrt(np.mean(np.square(own)))) if len(own) else 0.0
    return out


def _floor_of_rows(prepared: Prepared) -> Array:
    ev = prepared.problem.dataset
    floor = np.ones(ev.n)
    for s in ev.segments:
        floor[s.rows] = prepared.floors[s.channel].total
    return floor


def _background(prepared: Prepared) -> dict[str, float]:
    """RMS of what each channel is trusted to; the smaller where two views predict it."""
    ev = prepared.problem.dataset
    out: dict[str, float] = {}
    for key, size in _by_output(prepared, prepared.problem.whitening.s).items():
        channel = ev.rows_of(key)[0].channel
        out[channel] = min(size, out.get(channel, size))
    return out
