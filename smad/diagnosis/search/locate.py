"""Where, which law, what name, of one check-up: the search, read off and tried in the simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from sim_device.plant.laws import Law, joined
from smad.diagnosis.constants import Constants
from smad.diagnosis.data.played import finite, predictions
from smad.diagnosis.gap import Gap
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import Effect, Uncertainty
from smad.diagnosis.search.names import Entry
from smad.diagnosis.search.rows import fold_rows
from smad.diagnosis.search.told import Teller, one_of_each_place, side_words
from smad.diagnosis.search.where import Fits, Step, Where, fits, where
from smad.diagnosis.verdict import PlaceTold

Refine = Callable[[Sequence[Effect], Array], Entry | None]
"""The one of some effects that takes most of white rows."""


@dataclass(frozen=True)
class Alternative:
    """A place that may be the one, in words, and the law that it would have alone."""

    words: str
    laws: tuple[Law, ...]


@dataclass(frozen=True, kw_only=True)
class Located:
    """Answers, the laws behind them with what they leave uncertain, and what the simulator makes
    of laws that each run had no part in: `change` (bins, channels) of each pair.

    Laws that do not bring the simulator nearer to the bench are left out, and their change is 0.
    `alternatives` are the places of the first answer between which these runs do not decide.
    `beside_parameters` says whether the first takes enough to be told although other values of the
    parameters explain the rest.
    """

    told: tuple[PlaceTold, ...]
    laws: tuple[Law, ...]
    uncertainty: Uncertainty | None
    change: tuple[Array, ...]
    alternatives: tuple[Alternative, ...]
    beside_parameters: bool
    where: Where
    square: float
    count: int


def locate(
    gap: Gap,
    plant: PlacesPlant,
    found: Responses,
    refine: Refine,
    *,
    constants: Constants,
    exclude: Sequence[str] = (),
) -> Located:
    """Search the places of a check-up.

    A further place counts only if its law brings the simulator nearer to the bench, in runs that
    had no part in it. An effect is a name for a place only where it acts there or at a place near
    it, and takes enough of what the law takes.
    """
    rows = fold_rows(gap, found)
    w = where(rows, found.candidates(), constants)
    effects = [e for e in plant.effects if e.name not in exclude]
    named = named_steps(rows, w.steps, effects, refine, constants.name_share)
    tried = _tried(gap, found, rows, [n.step for n in named])
    kept = [n.step for n in named[: len(tried)]]
    shown = named[: max(len(tried), 1)]
    told: list[PlaceTold] = []
    if shown:
        teller = Teller(plant, gap, found, fits(rows, [n.step for n in shown]))
        for k, n in enumerate(shown):
            one = teller.told(n.step, n.share, in_simulator=k < len(tried))
            told.append(msgspec.structs.replace(one, **n.name))
    laws, uncertainty = _laws(found, fits(rows, kept)) if kept else ((), None)
    still = tuple(np.zeros_like(b) for b in gap.base)
    return Located(
        told=tuple(told), laws=laws, uncertainty=uncertainty, change=tried[-1] if tried else still,
        alternatives=_alternatives(plant, found, rows, shown[0].step) if shown else (),
        beside_parameters=bool(shown) and shown[0].share >= constants.beside_parameters,
        where=w, square=rows.square, count=rows.count,
    )  # fmt: skip


@dataclass(frozen=True)
class Named:
    """A step with what it adds, and what is told of its name."""

    step: Step
    share: float
    name: dict[str, Any]


def named_steps(
    rows: FoldRows,
    steps: Sequence[Step],
    effects: Sequence[Effect],
    refine: Refine,
    least: float,
) -> list[Named]:
    """The effect that takes most at each place, beside the laws of the places before.

    Among places that these runs do not tell apart, the one where a named effect acts comes first.
    """
    out: list[Named] = []
    left, before = rows, 0.0
    for step in steps:
        change = _change(left, fits(left, [step]))
        law_gain = _gain(left.rows, change)
        entry = refine([e for e in effects if _acts(e, step)], left.rows)
        own, told = step, _name(entry, law_gain, least)
        if told.get("name"):
            (effect,) = (e for e in effects if e.name == told["name"])
            own = _first_at(step, effect)
        out.append(Named(own, step.share - before, told))
        left, before = replace(left, rows=left.rows - change), step.share
    return out


def _first_at(step: Step, effect: Effect) -> Step:
    """The step with the best of its places where the effect acts as the chosen one."""
    first = next(
        s
        for s in one_of_each_place(step)
        if not effect.places or s.candidate.place in effect.places
    )
    rest = tuple(s for s in step.near if s.candidate.place != first.candidate.place)
    return replace(step, chosen=first, near=(first, *rest))


def _name(entry: Entry | None, law_gain: float, least: float) -> dict[str, Any]:
    if entry is None or entry.gain <= 0.0:
        return {}
    takes = entry.gain / max(law_gain, 1e-3 * entry.gain)
    told: dict[str, Any] = {"nearest": entry.name, "takes": takes}
    if takes >= least:
        told |= {"name": entry.name, "values": entry.values}
    return told


def _alternatives(
    plant: PlacesPlant, found: Responses, rows: FoldRows, step: Step
) -> tuple[Alternative, ...]:
    places = {p.name: p for p in plant.places}
    out = []
    for scored in one_of_each_place(step):
        own = fits(rows, [replace(step, chosen=scored)])
        words = side_words(places[scored.candidate.place], scored.candidate.side)
        out.append(Alternative(words, found.law_of(own.columns, own.fit.mean)))
    return tuple(out)


def _change(rows: FoldRows, own: Fits) -> Array:
    return np.asarray(rows.responses[own.columns].astype(np.float64).T @ own.fit.mean)


def _gain(rows: Array, change: Array) -> float:
    return float(2.0 * rows @ change - change @ change)


def _acts(effect: Effect, step: Step) -> bool:
    """Whether an effect may act at one of a step's places; one that names no place, at any."""
    return not effect.places or bool({s.candidate.place for s in step.near} & set(effect.places))


def _laws(found: Responses, own: Fits) -> tuple[tuple[Law, ...], Uncertainty]:
    """Laws for a model file, and the covariance of their coefficients by the names it has there."""
    homes = [found.home(int(c)) for c in own.columns]
    names = tuple(law.name_of(term) for law, term in homes)
    s = np.array([found.scales[law.place] for law, _ in homes])
    return (
        found.law_of(own.columns, own.fit.mean),
        Uncertainty(names, s[:, None] * own.fit.covariance * s),
    )


def _tried(
    gap: Gap, found: Responses, rows: FoldRows, steps: Sequence[Step]
) -> list[tuple[Array, ...]]:
    """What the simulator makes of the laws of 1, 2 … places, as far as each brings it nearer."""
    kept: list[tuple[Array, ...]] = []
    least = float(gap.z @ gap.z)
    for n in range(1, len(steps) + 1):
        change = _in_simulator(gap, found, fits(rows, steps[:n]), rows.fold)
        if change is None:
            break
        left = gap.z - gap.rows([c[None] for c in change])[0]
        if (square := float(left @ left)) >= least:
            break
        least = square
        kept.append(change)
    return kept


def _in_simulator(gap: Gap, found: Responses, own: Fits, fold: Index) -> tuple[Array, ...] | None:
    """The change of each run with laws fitted without it; None where it cannot be simulated."""
    point = gap.point
    out = []
    for k, (played, base) in enumerate(zip(gap.played, gap.base, strict=True)):
        mine = np.unique(fold[(gap.run_of_row == k) & (fold >= 0)])
        values = np.mean([own.without[f] for f in mine], axis=0) if len(mine) else own.fit.mean
        laws = found.law_of(own.columns, values)
        (moved,) = predictions(
            gap.plant, replace(point, laws=joined((*point.laws, *laws))), [played]
        )
        if not finite([moved]):
            return None
        out.append(moved - base)
    return tuple(out)
