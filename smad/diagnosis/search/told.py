"""What is told of a place and its law: words, slopes with units, sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_device.plant.laws import Term
from smad.diagnosis.data.played import Atom
from smad.diagnosis.gap import Gap
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.places.place import BOTH, Place, PlacesPlant
from smad.diagnosis.places.responses import Candidate, Responses, law_series
from smad.diagnosis.plant import Effect, ModelPoint, Uncertainty
from smad.diagnosis.search.where import Fits, Scored, Step, best_of_places
from smad.diagnosis.verdict import ParameterTold, PlaceShare, PlaceTold, TermTold

LEAST_TOLD = 0.05
"""An effect less probable than this is not worth reading."""


@dataclass(frozen=True)
class Teller:
    """Reads laws that were fitted together."""

    gap: Gap
    found: Responses
    own: Fits

    def told(self, step: Step, share: float, *, in_simulator: bool) -> PlaceTold:
        """What is told of a step; `share` is what it adds."""
        chosen, entry = step.chosen.candidate, step.entry
        place = next(p for p in self.gap.plant.places if p.name == chosen.place)
        likely = sorted(step.effects.items(), key=lambda item: -item[1])
        name = entry.name if entry is not None and step.named else ""
        return PlaceTold(
            place=chosen.place,
            side=chosen.side,
            words=words_of(self.gap.plant, chosen),
            share=min(share, 1.0),
            near=[words_of(self.gap.plant, s.candidate) for s in step.near[1:]],
            near_places=[s.candidate.place for s in step.near],
            probabilities=[step.places[s.candidate.place] for s in step.near],
            terms=self._terms(step, place),
            largest=self._largest(step),
            unit=place.unit,
            in_simulator=in_simulator,
            name=name,
            values={name: entry.values} if entry is not None and name else {},
            names={n: p for n, p in likely if p >= LEAST_TOLD},
            nearest="" if entry is None else entry.name,
            takes=0.0 if entry is None else step.takes,
        )

    def _at(self, step: Step) -> Index:
        """Where the step's responses stand in the fit."""
        first = {int(c): n for n, c in reversed(list(enumerate(self.own.columns)))}
        return np.array([first[int(c)] for c in step.chosen.columns])

    def _terms(self, step: Step, place: Place) -> list[TermTold]:
        sd = np.sqrt(np.maximum(np.diag(self.own.fit.covariance), 0.0))
        at, width = self._at(step), step.chosen.candidate.groups.shape[1]
        out: list[TermTold] = []
        for k, name in enumerate(step.chosen.terms):
            slopes, spread = {}, {}
            unit, words, state = place.unit, "", ""
            for n in at[width * k : width * (k + 1)]:
                law, term = self.found.home(int(self.own.columns[n]))
                span, unit, words, state = self._read(law.place, term, place.unit)
                slopes[law.side] = place.scale * float(self.own.fit.mean[n]) / span
                spread[law.side] = place.scale * float(sd[n]) / span
            out.append(
                TermTold(name=name, state=state, words=words, slopes=slopes, sd=spread, unit=unit)
            )
        return out

    def _largest(self, step: Step) -> float:
        most = 0.0
        at = self._at(step)
        for law in self.found.law_of(self.own.columns[at], self.own.fit.mean[at]):
            for p in self.gap.played:
                states = self.gap.plant.trajectory(self.gap.point, p.run, fast=True)
                series = law_series(self.gap.plant, law, states, p.run.t_s)
                most = max(most, float(np.abs(series).max(initial=0.0)))
        return most

    def _read(self, place: str, term: Term, unit: str) -> tuple[float, str, str, str]:
        """The span of a term's state, the unit of its slope, what it goes with, and its state."""
        if not term.factors:
            return 1.0, unit, "always", ""
        factor, *more = term.factors
        label, own = self.gap.plant.state_words(place, factor.state)
        label += f", behind by {factor.lag_s:g} s" if factor.lag_s else ""
        if more:
            other, _ = self.gap.plant.state_words(place, more[0].state)
            return 1.0, unit, f"{label} times {other}", factor.state
        if factor.kind == "sign":
            return 1.0, unit, f"sign of the {label}", factor.state
        if factor.kind == "bend":
            label += f" above {factor.centre:.3g} {own}"
        slope = unit if own == "1" else f"{unit}/({own})" if "/" in own else f"{unit}/{own}"
        return factor.scale, slope, label, factor.state


def words_of(plant: PlacesPlant, candidate: Candidate) -> str:
    """A place with its spring, as users read it."""
    place = next(p for p in plant.places if p.name == candidate.place)
    if len(place.sides) < 2:
        return place.label
    return f"{place.label}, {'X and Y' if candidate.side == BOTH else candidate.side.upper()}"


def parameters_told(
    plant: PlacesPlant, start: ModelPoint, point: ModelPoint, uncertain: Uncertainty
) -> list[ParameterTold]:
    """The parameters of a model beside those that it had, with their deviation."""
    sd = np.sqrt(np.maximum(np.diag(uncertain.covariance), 0.0))
    return [
        ParameterTold(
            name=q.name, unit=q.unit, before=start.theta.get(q.name, q.nominal), after=after,
            sd=float(own), at_bound=bool(after <= q.low or after >= q.high),
        )
        for q, own in zip(plant.parameters, sd, strict=False)
        for after in (point.theta.get(q.name, q.nominal),)
    ]  # fmt: skip


def place_shares(plant: PlacesPlant, ranked: Sequence[Scored]) -> list[PlaceShare]:
    """What each place alone takes, the best of its sides, best first."""
    return [
        PlaceShare(
            place=s.candidate.place, side=s.candidate.side, share=max(s.share, 0.0),
            words=words_of(plant, s.candidate),
        )
        for s in best_of_places(ranked)
    ]  # fmt: skip


def unseen(plant: PlacesPlant, rows: FoldRows, ranked: Sequence[Scored], need: float) -> list[str]:
    """For each place the size of a constant law that would take `need` off the sum of squares."""
    kept, best = rows.fold >= 0, {s.candidate.place: s.candidate for s in best_of_places(ranked)}
    out = []
    for place in (p for p in plant.places if p.name in best):
        words = words_of(plant, best[place.name])
        a = rows.responses[best[place.name].groups[0]][:, kept].astype(np.float64).sum(axis=0)
        square = float(a @ a)
        if square <= 0.0:
            out.append(f"{words}: nothing, whatever its size")
            continue
        size = place.scale * np.sqrt(need / square)
        text = f"{100 * size:.2g} %" if place.unit == "1" else f"{size:.2g} {place.unit}"
        out.append(f"{words}: less than {text}, always there")
    return out


def unseen_effects(
    effects: Sequence[Effect], atoms: Sequence[Atom], S: Array, need: float
) -> list[str]:
    """For each effect the strength that would take `need` off the sum of squares, least seen first.

    `S` (atoms, rows) are white signatures. The level that shows nearly as much as is needed tells,
    scaled; shapes are typical.
    """
    out: list[tuple[float, str]] = []
    for effect in effects:
        for q in effect.parameters:
            own = [
                (float(S[i] @ S[i]), a.values[q.name])
                for i, a in enumerate(atoms)
                if a.entry == effect.name and a.strength == q.name and a.variant == "typical"
            ]
            shown = [one for one in own if one[0] > 0.0]
            if not shown:
                continue
            square, value = min(shown, key=lambda one: abs(np.log(one[0] / need)))
            size = abs(value) * float(np.sqrt(need / square))
            unit = "" if q.unit == "1" else f" {q.unit}"
            text = f"less than {size:.2g}{unit}" if size < q.high else "anything within its range"
            out.append((size / abs(q.typical), f"{effect.name}, {q.name}: {text}"))
    return [text for _, text in sorted(out, reverse=True)]
