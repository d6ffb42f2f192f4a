"""Rivals, places and laws in words, with units."""

from collections.abc import Mapping, Sequence

import numpy as np

from sim_device.plant import Term
from smad.diagnosis.places.place import BOTH, PlacesPlant, place_named, states_seen
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.parts import EffectPart, LawPart, Part
from smad.diagnosis.rivals.rival import Rival
from smad.diagnosis.rivals.score import EFFECT, LAW, PARAMETERS
from smad.diagnosis.verdict import EffectValue, LawTerm

_ALIKE = 0.95
"""Squared correlation above which two states are not distinguished."""


def rival_words(plant: PlacesPlant, rival: Rival) -> str:
    """A row of the table of rivals."""
    if rival.kind == EFFECT:
        return rival.name
    if rival.kind == LAW:
        return part_words(plant, rival.parts[-1])
    if PARAMETERS in (rival.kind, rival.name):
        return "parameters alone"
    if rival.fit is None:
        return "the simulator as configured"
    return "nothing more" if rival.parts else "day-to-day variation alone"


def part_words(plant: PlacesPlant, part: Part) -> str:
    """An effect by its name, a law by its place."""
    if isinstance(part, EffectPart):
        return part.name
    return f"a law at the {where_words(plant, part.candidate.place, part.candidate.side)}"


def where_words(plant: PlacesPlant, name: str, side: str) -> str:
    """A place with its spring, as users read it."""
    place = next((p for p in plant.places if p.name == name), None)
    if place is None:
        return name or "model"
    # The brackets of a label say what a law is a share of.
    label = place.label.partition(" (")[0]
    return label if len(place.sides) < 2 or side == BOTH else f"{label}, {side.upper()}"


def effect_values(part: EffectPart, x: Array, sd: Array | None) -> list[EffectValue]:
    """An effect's parameters at coordinates `x` (k,) with deviations `sd` (k,), if they are known,
    the largest strength first and the shapes last.
    """
    deviations = [None] * len(x) if sd is None else sd.tolist()
    rows = sorted(
        zip(part.effect.parameters, x, deviations, strict=True),
        key=lambda row: -abs(row[1]) if row[0].strength else np.inf,
    )
    return [
        EffectValue(
            name=q.name,
            value=float(v) * q.scale,
            sd=None if s is None else s * q.scale,
            unit=q.unit,
            at_bound=bool(q.strength and v != 0.0 and v in (q.low / q.scale, q.high / q.scale)),
        )
        for q, v, s in rows
    ]


def law_terms(
    plant: PlacesPlant,
    part: LawPart,
    x: Array,
    sd: Array,
    trajectories: Sequence[Mapping[str, Array]],
) -> list[LawTerm]:
    """The terms of a law at coordinates `x` (k,) with deviations `sd` (k,)."""
    place = place_named(plant, part.candidate.place)
    seen = [states_seen(plant, place.name, part.candidate.side, t) for t in trajectories]
    out: dict[str, LawTerm] = {}
    for column, value, deviation in zip(part.columns, x, sd, strict=True):
        law, term = part.responses.homes[column]
        span, unit, words, state = _read(plant, law.place, term, place.unit)
        if term.name not in out:
            out[term.name] = LawTerm(
                name=term.name,
                state=state,
                words=words,
                slopes={},
                sd={},
                unit=unit,
                alike=_alike_words(plant, place.name, state, seen),
            )
        out[term.name].slopes[law.side] = place.scale * float(value) / span
        out[term.name].sd[law.side] = place.scale * float(deviation) / span
    return list(out.values())


def _alike_words(
    plant: PlacesPlant, place: str, state: str, seen: Sequence[Mapping[str, Array]]
) -> str:
    """A sentence on states that the runs do not distinguish from `state`; empty without any."""
    names = [plant.state_words(place, n)[0] for n in (state, *alike(state, seen)) if n]
    if len(names) < 2:
        return ""
    return f"these runs do not tell {names[0]} from {' or '.join(names[1:])}"


def _read(plant: PlacesPlant, place: str, term: Term, unit: str) -> tuple[float, str, str, str]:
    """The span of a term's state, the unit of its slope, what it goes with, and its state."""
    if not term.factors:
        return 1.0, unit, "always", ""
    # No candidate is a product of two.
    (factor,) = term.factors
    label, of_state = plant.state_words(place, factor.state)
    label += f", behind by {factor.lag_s:g} s" if factor.lag_s else ""
    if factor.kind == "sign":
        return 1.0, unit, f"sign of the {label}", factor.state
    if factor.kind == "bend":
        label += f" above {factor.centre:.3g} {of_state}"
    per = f"({of_state})" if "/" in of_state else of_state
    return factor.scale, unit if of_state == "1" else f"{unit}/{per}", label, factor.state


def alike(state: str, seen: Sequence[Mapping[str, Array]]) -> list[str]:
    """States whose squared correlation with `state` over all runs is above `_ALIKE`."""
    if not seen or state not in seen[0]:
        return []
    joined = {n: np.concatenate([of_run[n] for of_run in seen]) for n in seen[0]}
    moving = {n: y - y.mean() for n, y in joined.items()}
    course = moving.pop(state)
    square = float(course @ course)
    return [
        n for n, y in moving.items() if float(course @ y) ** 2 > _ALIKE * square * float(y @ y) > 0
    ]
