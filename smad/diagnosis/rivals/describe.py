"""Rivals, places and laws in words, with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim_device.plant import Term
from smad.diagnosis.places.place import BOTH, PlacesPlant, single_sides
from smad.diagnosis.places.responses import law_series
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.fit import Fit
from smad.diagnosis.rivals.parts import EffectPart, LawPart
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import EFFECT, LAW, PARAMETERS
from smad.diagnosis.verdict import EffectValue, LawTerm

_ALIKE = 0.95
"""Squared correlation of two states from which on a law of one is as good with the other."""


@dataclass(frozen=True)
class Describer:
    """Says in the plant's words what a rival is."""

    plant: PlacesPlant

    def rival(self, rival: Rival) -> str:
        """A row of the table of rivals."""
        parts = rival.fit.model.parts if rival.fit is not None else ()
        if rival.kind == EFFECT:
            return rival.name
        if rival.kind == LAW:
            side = parts[-1].candidate.side if isinstance(parts[-1], LawPart) else BOTH
            return f"a law at the {self.place(rival.places[0], side)}"
        if rival.kind == PARAMETERS:
            return "parameters alone"
        if rival.fit is None:
            return "the simulator as configured"
        return "nothing more" if parts else "day-to-day variation alone"

    def place(self, name: str, side: str) -> str:
        """A place with its spring, as users read it."""
        place = next((p for p in self.plant.places if p.name == name), None)
        if place is None:
            return name or "model"
        # In brackets stands what a law is a share of.
        label = place.label.partition(" (")[0]
        return label if len(place.sides) < 2 or side == BOTH else f"{label}, {side.upper()}"

    def values(self, part: EffectPart, x: Array, sd: Array) -> list[EffectValue]:
        """An effect's parameters at coordinates `x` (k,) with deviations `sd` (k,).

        Strengths come first, the one that acts most of all.
        """
        rows = sorted(
            zip(part.effect.parameters, x, sd, strict=True),
            key=lambda row: -abs(row[1]) if row[0].strength else np.inf,
        )
        return [
            EffectValue(name=q.name, value=float(v) * q.scale, sd=float(s) * q.scale, unit=q.unit)
            for q, v, s in rows
        ]

    def terms(
        self, part: LawPart, x: Array, sd: Array, trajectories: Sequence[Mapping[str, Array]]
    ) -> list[LawTerm]:
        """The terms of a law at coordinates `x` (k,) with deviations `sd` (k,)."""
        place = next(p for p in self.plant.places if p.name == part.candidate.place)
        side = single_sides(place, part.candidate.side)[0]
        seen = [self.plant.seen(place.name, side, t) for t in trajectories]
        out: dict[str, LawTerm] = {}
        for column, value, deviation in zip(part.columns, x, sd, strict=True):
            law, term = part.responses.home(int(column))
            span, unit, words, state = self._read(law.place, term, place.unit)
            so_far = out.get(term.name)
            slopes = {} if so_far is None else dict(so_far.slopes)
            spread = {} if so_far is None else dict(so_far.sd)
            slopes[law.side] = place.scale * float(value) / span
            spread[law.side] = place.scale * float(deviation) / span
            out[term.name] = LawTerm(
                name=term.name,
                state=state,
                words=words,
                slopes=slopes,
                sd=spread,
                unit=unit,
                alike=self._alike(place.name, state, seen),
            )
        return list(out.values())

    def _alike(self, place: str, state: str, seen: Sequence[Mapping[str, Array]]) -> str:
        """Which states the runs do not tell from one, in words; empty where there are none."""
        names = [self.plant.state_words(place, n)[0] for n in (state, *alike(state, seen)) if n]
        if len(names) < 2:
            return ""
        return f"these runs do not tell {names[0]} from {' or '.join(names[1:])}"

    def trajectories(self, question: Question, fitted: Fit) -> list[Mapping[str, Array]]:
        """The states of a fit in its runs."""
        return [
            self.plant.trajectory(fitted.point, p.run, fast=True) for p in question.evidence.played
        ]

    def largest(
        self,
        part: LawPart,
        x: Array,
        question: Question,
        trajectories: Sequence[Mapping[str, Array]],
    ) -> float:
        """The largest value of a law in the runs, in the unit of its place."""
        most = 0.0
        for law in part.responses.law_of(part.columns, x):
            for played, states in zip(question.evidence.played, trajectories, strict=True):
                series = law_series(self.plant, law, states, played.run.t_s)
                most = max(most, float(np.abs(series).max(initial=0.0)))
        return most

    def _read(self, place: str, term: Term, unit: str) -> tuple[float, str, str, str]:
        """The span of a term's state, the unit of its slope, what it goes with, and its state."""
        if not term.factors:
            return 1.0, unit, "always", ""
        factor, *more = term.factors
        label, of_state = self.plant.state_words(place, factor.state)
        label += f", behind by {factor.lag_s:g} s" if factor.lag_s else ""
        if more:
            other, _ = self.plant.state_words(place, more[0].state)
            return 1.0, unit, f"{label} times {other}", factor.state
        if factor.kind == "sign":
            return 1.0, unit, f"sign of the {label}", factor.state
        if factor.kind == "bend":
            label += f" above {factor.centre:.3g} {of_state}"
        per = f"({of_state})" if "/" in of_state else of_state
        return factor.scale, unit if of_state == "1" else f"{unit}/{per}", label, factor.state


def alike(state: str, seen: Sequence[Mapping[str, Array]]) -> list[str]:
    """States that change with `state` in all runs together, as far as these tell."""
    if not seen or state not in seen[0]:
        return []
    joined = {n: np.concatenate([of_run[n] for of_run in seen]) for n in seen[0]}
    moving = {n: y - y.mean() for n, y in joined.items()}
    course = moving.pop(state)
    square = float(course @ course)
    return [
        n for n, y in moving.items() if float(course @ y) ** 2 > _ALIKE * square * float(y @ y) > 0
    ]
