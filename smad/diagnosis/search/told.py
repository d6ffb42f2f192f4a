"""What is told of a place and its law: words, slopes with units, sizes."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from sim_device.plant.laws import Law, Term, design_matrix
from sim_device.plant.places import STATES
from smad.diagnosis.numerics.folds import Array, Index
from smad.diagnosis.places.responses import PlacesPlant, Responses
from smad.diagnosis.search.where import Fits, Scored, Step
from smad.gap.paired.difference import Paired
from smad.gap.places import BOTH, Place
from smad.gap.runs import GapRun

_STATES = {s.name: s for s in STATES}


class TermTold(msgspec.Struct, frozen=True, kw_only=True):
    """A term of a law: what it goes with in `words`, its `slopes` by spring with their standard
    deviations `sd`, in `unit`."""

    name: str
    words: str
    slopes: dict[str, float]
    sd: dict[str, float]
    unit: str

    @property
    def text(self) -> str:
        """What it goes with and how, as users read it."""
        slopes = ", ".join(
            f"{'' if side == BOTH else side.upper() + ' '}{v:+.2g} ± {self.sd[side]:.1g}"
            for side, v in self.slopes.items()
        )
        return f"{self.words}: {slopes}{'' if self.unit == '1' else ' ' + self.unit}"


class PlaceTold(msgspec.Struct, frozen=True, kw_only=True):
    """One answer: where, which law, what name.

    `share` is what the place adds to the held-out part of the change, in squares of white rows;
    `near` are places that do nearly as well. `largest` is the law's largest value in the runs, in
    `unit`. `in_simulator` says whether the law brought the simulator nearer to the bench. `name` is
    an effect of the library that acts there, empty for none; `nearest` the best of those that act
    there, `takes` what it takes of what the law takes.
    """

    place: str
    side: str
    words: str
    share: float
    near: list[str]
    terms: list[TermTold]
    largest: float
    unit: str
    in_simulator: bool
    name: str = ""
    values: dict[str, dict[str, float]] = {}
    nearest: str = ""
    takes: float = 0.0

    @property
    def read(self) -> list[TermTold]:
        """The terms that say something: a constant only where there is no other.

        Beside others it depends on where the middle of their states lies.
        """
        return self.terms[:-1] if len(self.terms) > 1 else self.terms


@dataclass(frozen=True)
class Teller:
    """Reads laws that were fitted together."""

    plant: PlacesPlant
    pairs: Paired
    found: Responses
    own: Fits

    def told(self, step: Step, share: float, *, in_simulator: bool) -> PlaceTold:
        """A step without a name yet; `share` is what it adds."""
        places = {p.name: p for p in self.plant.places}
        chosen = step.chosen.candidate
        place = places[chosen.place]
        return PlaceTold(
            place=chosen.place,
            side=chosen.side,
            words=side_words(place, chosen.side),
            share=share,
            near=[
                side_words(places[s.candidate.place], s.candidate.side)
                for s in one_of_each_place(step)[1:]
            ],
            terms=self._terms(step, place),
            largest=self._largest(step),
            unit=place.unit,
            in_simulator=in_simulator,
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
            unit, words = place.unit, ""
            for n in at[width * k : width * (k + 1)]:
                law, term = self.found.home(int(self.own.columns[n]))
                span, unit, words = _read(term, place.unit)
                slopes[law.side] = place.scale * float(self.own.fit.mean[n]) / span
                spread[law.side] = place.scale * float(sd[n]) / span
            out.append(TermTold(name=name, words=words, slopes=slopes, sd=spread, unit=unit))
        return out

    def _largest(self, step: Step) -> float:
        most = 0.0
        at = self._at(step)
        for law in self.found.law_of(self.own.columns[at], self.own.fit.mean[at]):
            for p in self.pairs.pairs:
                series = law_series(self.plant, self.pairs, law, p.reference.played.run)
                most = max(most, float(np.abs(series).max(initial=0.0)))
        return most


def side_words(place: Place, side: str) -> str:
    """A place with its spring, as users read it."""
    if len(place.sides) < 2:
        return place.label
    return f"{place.label}, {'X and Y' if side == BOTH else side.upper()}"


def law_series(plant: PlacesPlant, pairs: Paired, law: Law, run: GapRun) -> Array:
    """Values of a law on the reference trajectory of a run, in the unit of the place."""
    states = plant.trajectory(pairs.reference.point, run, fast=True)
    X = design_matrix(law.place, law.side, states, law.terms, run.t_s)
    return np.asarray(X @ np.array([t.coefficient for t in law.terms]))


def one_of_each_place(step: Step) -> list[Scored]:
    """The chosen candidate, and the best one of each other place that does nearly as well."""
    best: dict[str, Scored] = {}
    for s in (step.chosen, *step.near):
        best.setdefault(s.candidate.place, s)
    return list(best.values())


def _read(term: Term, unit: str) -> tuple[float, str, str]:
    """The span of a term's state, the unit of its slope, and what it goes with."""
    if not term.factors:
        return 1.0, unit, "always"
    (factor,) = term.factors
    state = _STATES[factor.state]
    own = {"reading": unit, "reading_rate": f"{unit}/s"}.get(factor.state, state.unit)
    label = state.label + (f", behind by {factor.lag_s:g} s" if factor.lag_s else "")
    if factor.kind == "sign":
        return 1.0, unit, f"sign of the {label}"
    slope = unit if own == "1" else f"{unit}/({own})" if "/" in own else f"{unit}/{own}"
    return factor.scale, slope, label
