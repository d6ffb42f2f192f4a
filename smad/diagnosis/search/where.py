"""Where: the place whose law takes most of rows that it was not fitted to.

A candidate is a place on spring X, Y or both, with the terms that its law may have. Of each a law
of a few terms is selected and judged by leaving runs out. Laws and effects of the library are
hypotheses with probabilities; places that hold most of it are told together, since the runs do not
tell them apart. A further place is sought beside those before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.forward import Fit, Forward, fitted, forward
from smad.diagnosis.places.responses import Candidate
from smad.diagnosis.search.names import Naming, score
from smad.diagnosis.search.odds import NAMED, Hypothesis, odds, of_places, shares, told
from smad.diagnosis.search.refine import Refined

MOST_TERMS = 3
"""Terms of a law at most, so that it can be read."""
MOST_PLACES = 3
"""Places at most that add to each other."""
WORTH_TELLING = 0.03
"""A place that takes a smaller share is not told."""
_SIMPLER = 0.97
"""What a term of one order more is worth, and a law on both springs beside one on either."""


@dataclass(frozen=True)
class Scored:
    """A candidate and the law that was selected: its `share` of held-out rows, beside others."""

    candidate: Candidate
    forward: Forward
    share: float

    @property
    def terms(self) -> tuple[str, ...]:
        """The law's terms, the one without which most would be lost first, the constant last."""
        return tuple(self.candidate.terms[g] for g in self._groups)

    @property
    def columns(self) -> Index:
        """Numbers of the law's responses, term by term."""
        return self.candidate.groups[list(self._groups)].ravel()

    @property
    def _groups(self) -> tuple[int, ...]:
        return (*(1 + g for g in self.forward.chosen), 0)


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of the search: the likeliest place beside those before, and who may be it too.

    `share` is what all steps so far take together; `near` begins with the chosen one. `places` and
    `effects` are the probabilities of all `hypotheses`, where something is missing. `entry` is the
    effect of the library that is likeliest there, `takes` what it takes over what the law takes;
    it `stands` in place of the law where effects may, and it takes more. `gains` (channels,) are
    what of the two stands takes.
    """

    chosen: Scored
    near: tuple[Scored, ...]
    share: float
    gains: Array
    hypotheses: tuple[Hypothesis, ...] = ()
    places: dict[str, float] = field(default_factory=dict)
    effects: dict[str, float] = field(default_factory=dict)
    entry: Refined | None = None
    takes: float = 0.0
    named: bool = False
    stands: bool = False


@dataclass(frozen=True)
class Where:
    """`ranked`: every candidate alone, best first. `steps`: places that add to each other. Shares
    are of `size`, in squares of rows."""

    size: float
    ranked: tuple[Scored, ...]
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Fits:
    """The responses `columns` (k,) fitted to all folds, and coefficients without each fold."""

    columns: Index
    fit: Fit
    without: tuple[Array, ...]


def where(
    rows: FoldRows,
    candidates: Sequence[Candidate],
    constants: Constants,
    *,
    least: float,
    most: int = MOST_PLACES,
    worth: float = WORTH_TELLING,
    naming: Naming | None = None,
    size: float | None = None,
    effects_stand: bool = False,
) -> Where:
    """Return candidates by held-out share, and the places that add to each other.

    Shares are of `size`, the rows' sum of squares, or what of it a bench without a change lacks;
    of what the best law takes, where that is more.
    A place enters while twice the log predictive density that it adds to held-out rows (Geisser
    1975), each channel by the variance that it is left with, exceeds `least`, to at most `most`. A
    later one must take a share `worth` telling of what there was to take, each channel by its own:
    a second cause is seen where the first says nothing, however small it is beside it. Later places
    are beside the law of one before, or beside its effect where that takes more and
    `effects_stand`.
    """
    now, steps, taken = np.zeros(0, dtype=np.intp), list[Step](), 0.0
    left, entries, there = rows, 0.0, np.zeros(rows.channels)
    alone = _scored(left, now, candidates, size=1.0)
    size = max(rows.square if size is None else size, alone[0].share if alone else 0.0, 1e-12)
    ranked = scored = tuple(replace(s, share=s.share / size) for s in alone)
    while scored and len(steps) < most:
        beside = replace(left, rows=_beside(left, now))
        laws = best_of_places(scored)
        step = step_of(
            laws, _gains(left, now, laws), constants, taken=taken, size=size, naming=naming,
            noise=least, left=beside, effects_stand=effects_stand,
        )  # fmt: skip
        if density_gained(beside, step.gains) < least:
            break
        there = there if steps else np.max([h.gains for h in step.hypotheses], axis=0)
        if steps and shares(step.gains[None], least, there)[0] < worth:
            break
        steps.append(step)
        taken = step.share
        if step.stands and step.entry is not None:
            entries += step.entry.gain / size
            left = replace(left, rows=left.rows - step.entry.change)
        else:
            now = np.concatenate([now, step.chosen.columns])
        naming = without_named(naming, step)
        rest = not_told(candidates, steps)
        scored = _scored(left, now, rest, size=size, before=entries, least=taken)
    return Where(size, ranked, tuple(steps))


def best_of_places(ranked: Sequence[Scored]) -> list[Scored]:
    """The best candidate of each place, of candidates that come best first."""
    best: dict[str, Scored] = {}
    for s in ranked:
        best.setdefault(s.candidate.place, s)
    return list(best.values())


def not_told(candidates: Sequence[Candidate], steps: Sequence[Step]) -> list[Candidate]:
    """Those of places that no step has told."""
    told = {s.chosen.candidate.place for s in steps}
    return [c for c in candidates if c.place not in told]


def step_of(
    best: Sequence[Scored],
    gains: Sequence[Array],
    constants: Constants,
    *,
    taken: float,
    size: float,
    naming: Naming | None,
    noise: float,
    left: FoldRows,
    effects_stand: bool = False,
) -> Step:
    """The step that the likeliest place makes, with its likeliest effect.

    Hypotheses are the `best` law of each place, and effects of the library refined by replay, each
    at the one of its places whose law takes most. `gains` are what a law takes of each channel,
    held out, of the rows `left`. An effect is the name when it has `NAMED` of the probability.
    Where only laws stand, places count whose own law adds to the rows.
    """
    laws = {s.candidate.place: s for s in best}
    taken_by = dict(zip(laws, gains, strict=True))
    if not effects_stand:
        adds = {p for p, g in taken_by.items() if density_gained(left, g) >= noise}
        laws = {p: s for p, s in laws.items() if p in adds} or laws
    found = [] if naming is None else naming.refine(naming.effects, left.rows)
    square = left.by_channel(left.rows)
    hypotheses = [Hypothesis(place=p, gains=taken_by[p]) for p in laws]
    entries: dict[str, Refined] = {}
    for e in found:
        acts = e.effect.places
        at = next((p for p in laws if p in acts or not acts), None)
        if at is not None:
            own = square - left.by_channel(left.rows - e.change)
            hypotheses.append(Hypothesis(place=at, effect=e.name, gains=own))
            entries[e.name] = e
    probability = odds(hypotheses, constants, noise)
    places = of_places(hypotheses, probability)
    near = tuple(laws[p] for p in told(places, constants.told_level))
    chosen = near[0]
    effects = {h.effect: float(p) for h, p in zip(hypotheses, probability, strict=True) if h.effect}
    here = [h.effect for h in hypotheses if h.effect and h.place == chosen.candidate.place]
    name = max(here, key=lambda n: effects[n], default="")
    entry = entries.get(name)
    gain = 0.0 if entry is None else score(entry) / size
    law = max(chosen.share - taken, 0.0)
    named = bool(name) and effects[name] >= NAMED
    stands = effects_stand and entry is not None and (named or gain > law)
    of = name if stands else ""
    return Step(
        chosen=chosen, near=near, hypotheses=tuple(hypotheses), places=places, effects=effects,
        entry=entry, named=named, stands=stands, share=taken + (gain if stands else law),
        gains=next(h.gains for h in hypotheses if h.place == chosen.candidate.place
                   and h.effect == of),
        takes=gain / max(law, 1e-3 * gain, 1e-12),
    )  # fmt: skip


def without_named(naming: Naming | None, step: Step) -> Naming | None:
    """The effects that may still be named: one that says where it acts is told once."""
    entry = step.entry
    if naming is None or entry is None or not (step.named and entry.effect.places):
        return naming
    return naming.without(entry.name)


def density_gained(rows: FoldRows, gains: Array) -> float:
    """Twice the log predictive density that rows gain, each channel by the variance it is left.

    `gains` (channels,) are what is taken off the squares of the rows.
    """
    after = np.maximum(rows.by_channel(rows.rows) - gains, 1e-9)
    count = rows.by_channel(np.ones(len(rows.rows)))
    return float(np.sum(gains / np.maximum(after / np.maximum(count, 1.0), 1.0)))


def _gains(rows: FoldRows, now: Index, laws: Sequence[Scored]) -> list[Array]:
    """What laws take of each channel of rows they were not fitted to, beside responses `now`."""
    before = rows.by_channel(left_out(rows, now))
    beside = (np.concatenate([now, np.setdiff1d(s.columns, now)]) for s in laws)
    return [before - rows.by_channel(left_out(rows, columns)) for columns in beside]


def left_out(rows: FoldRows, columns: Index) -> Array:
    """What these responses leave of rows, each fold by coefficients of the others; (rows,)."""
    left = rows.rows.copy()
    products = rows.products(columns)
    A = rows.responses[columns].astype(np.float64)
    for f in range(products.folds):
        own = rows.fold == f
        left[own] -= A[:, own].T @ fitted(products.without(f)).mean
    return left


def _beside(rows: FoldRows, columns: Index) -> Array:
    """The rows less what these responses take of them."""
    x = fitted(rows.products(columns)).mean
    return np.asarray(rows.rows - rows.responses[columns].astype(np.float64).T @ x)


def _scored(
    rows: FoldRows,
    now: Index,
    candidates: Sequence[Candidate],
    *,
    size: float,
    before: float = 0.0,
    least: float = 0.0,
) -> tuple[Scored, ...]:
    """Candidates beside the responses `now`, best first; `before` was taken off the rows."""
    out = []
    for c in candidates:
        found = selected(rows, np.concatenate([now, np.setdiff1d(c.groups[0], now)]), c)
        out.append(Scored(c, found, max(before + found.best / size, least)))
    return tuple(
        sorted(out, key=lambda s: (-worth_of_side(s), s.candidate.place, s.candidate.side))
    )


def selected(rows: FoldRows, always: Index, c: Candidate, shift: int = 0) -> Forward:
    """The terms of a candidate that take most beside the responses that are `always` in.

    Its responses begin `shift` later; a term of which one is in already is not asked.
    """
    numbers = c.groups[1:] + shift
    groups = np.flatnonzero(~np.isin(numbers, always).any(axis=1))
    free = np.unique(numbers[groups])
    asked = len(always) + np.searchsorted(free, numbers[groups])
    products = rows.products(np.concatenate([always, free]))
    found = forward(products, asked, worth_of(c)[groups], depth=MOST_TERMS, before=len(always))
    return replace(found, chosen=tuple(int(groups[g]) for g in found.chosen))


def worth_of_side(s: Scored) -> float:
    """A candidate's share, less where its law has coefficients for two springs."""
    return s.share * (_SIMPLER if s.candidate.groups.shape[1] > 1 else 1.0)


def worth_of(c: Candidate) -> Array:
    """What each term but the constant is worth: simpler ones go first."""
    return np.asarray(_SIMPLER ** (np.array(c.orders[1:]) - 1.0))


def fits(rows: FoldRows, steps: Sequence[Step]) -> Fits:
    """The laws of these steps fitted together."""
    columns = np.concatenate([np.zeros(0, dtype=np.intp), *(s.chosen.columns for s in steps)])
    products = rows.products(columns)
    without = (fitted(products.without(f)).mean for f in range(products.folds))
    return Fits(columns, fitted(products), tuple(without))
