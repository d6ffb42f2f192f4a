"""Responses of a plant's readings to each term of a law at each place.

They are computed once at a reference point. A term is evaluated on the *reference* trajectory, so
that responses are linear in a law's coefficients. At a reading the forcing adds to one channel, and
one replay gives the response to all terms; elsewhere each term costs a replay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import accumulate

import numpy as np

from sim_device.plant import Law, Term, joined, terms_over
from sim_device.plant.errors import PlantError
from smad.diagnosis.data.played import Played, finite
from smad.diagnosis.numerics.threads import each
from smad.diagnosis.places.bare import BarePlaces
from smad.diagnosis.places.place import BOTH, Forcing, PlacesPlant, law_values
from smad.diagnosis.plant import Array, Index, ModelPoint, Singles, traits_of
from smad.diagnosis.runs import ranges_of
from smad.progress import Say, silent


@dataclass(frozen=True, eq=False)
class Candidate:
    """A hypothesis of where: a place, a side, and the terms that a law may have there.

    `groups` (m, w) are the columns of each term's responses, one for each side that it acts on. The
    first term is the constant, which is in every law: lines of the others are 0 in the middle of
    the state's range. `orders` (m,) are 1 for a line and more for less simple terms.
    """

    place: str
    side: str
    groups: Index
    orders: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Responses to every term, each with a coefficient of one scale of its place.

    `laws` have the candidate terms of each place and single side, `scales` the scale of each place
    in its unit. `runs` has one array (terms, bins, channels) for each run.
    """

    laws: tuple[Law, ...]
    scales: Mapping[str, float]
    runs: tuple[Singles, ...]

    @cached_property
    def columns(self) -> tuple[range, ...]:
        """Columns of the terms of each law."""
        stops = accumulate(len(law.terms) for law in self.laws)
        return tuple(range(b - len(x.terms), b) for x, b in zip(self.laws, stops, strict=True))

    def candidates(self) -> list[Candidate]:
        """Each place on each of its sides, and on both where it has two."""
        by_place: dict[str, list[tuple[Law, range]]] = {}
        for law, columns in zip(self.laws, self.columns, strict=True):
            by_place.setdefault(law.place, []).append((law, columns))
        single = [
            _candidate(law.side, [(law, columns)]) for x in by_place.values() for law, columns in x
        ]
        return single + [_candidate(BOTH, x) for x in by_place.values() if len(x) > 1]

    @cached_property
    def homes(self) -> tuple[tuple[Law, Term], ...]:
        """Law and term of each column."""
        return tuple((law, term) for law in self.laws for term in law.terms)

    def coefficients(self, columns: Index) -> tuple[tuple[str, ...], Array]:
        """Names of columns in a model file, and the unit of their coefficients in that of the
        place.
        """
        homes = [self.homes[c] for c in columns]
        names = tuple(law.name_of(term) for law, term in homes)
        return names, np.array([self.scales[law.place] for law, _ in homes])

    def law_of(self, columns: Index, values: Array) -> tuple[Law, ...]:
        """The laws that these responses with these coefficients are, one for each place and side.

        A term that is given twice counts with the sum.
        """
        chosen = []
        for column, value in zip(columns, values, strict=True):
            law, term = self.homes[column]
            coefficient = self.scales[law.place] * float(value)
            chosen.append(replace(law, terms=(replace(term, coefficient=coefficient),)))
        return joined(chosen)


def _candidate(side: str, laws: Sequence[tuple[Law, range]]) -> Candidate:
    """The terms that laws of one place have in common."""
    by_law = [{t.name: n for t, n in zip(law.terms, columns, strict=True)} for law, columns in laws]
    first, _ = laws[0]
    terms = [t for t in first.terms if all(t.name in other for other in by_law)]
    groups = np.array([[columns[t.name] for columns in by_law] for t in terms], dtype=np.intp)
    return Candidate(first.place, side, groups, tuple(t.order for t in terms))


def candidate_laws(
    plant: PlacesPlant, point: ModelPoint, runs: Sequence[Played]
) -> tuple[Law, ...]:
    """Laws of all places and sides with terms over the states of the runs: lines, signs, lags.

    Bends and products would cost five times the replays. Bends are included for plants with bare
    places, which are few.
    """
    states = [plant.trajectory(point, p.run, fast=True) for p in runs]
    bare = isinstance(plant, BarePlaces)
    signed: Sequence[str] = ("velocity",)
    if bare:
        speeds = {c.name for c in plant.channels if c.unit.endswith("/s") or c.unit == "rpm"}
        signed = [n for n in plant.places[0].states if n.endswith("_rate") or n in speeds]
    laws: list[Law] = []
    for place in plant.places:
        for side in place.sides:
            support = ranges_of(plant.seen(place.name, side, trajectory) for trajectory in states)
            terms = terms_over(place.states, support, bends=bare, products=False, signed=signed)
            laws.append(Law(place.name, side, terms))
    return tuple(laws)


def responses(
    plant: PlacesPlant,
    point: ModelPoint,
    runs: Sequence[Played],
    *,
    stored: Sequence[Singles] | None = None,
    space: tuple[Law, ...] | None = None,
    progress: Say = silent,
) -> Responses:
    """Responses of all places at `point`; 0 for a term with which the model fails.

    `space` are the laws whose terms these are; else they are those over the states of the runs.
    `stored` are the arrays of an earlier call for the first runs, which are not replayed again.
    Raises ValueError where they do not fit.
    """
    laws = space or candidate_laws(plant, point, runs)
    count = sum(len(law.terms) for law in laws)
    arrays = list(stored or ())
    if any(len(array) != count for array in arrays):
        raise ValueError(f"responses of {len(arrays[0])} terms; the laws have {count}")
    for played in runs[len(arrays) :]:
        progress(f"responses of the places: {played.whole.name}")
        arrays.append(_replayed(plant, point, played.coarse, laws))
    scales = {place.name: place.scale for place in plant.places}
    return Responses(laws=laws, scales=scales, runs=tuple(arrays))


def _replayed(
    plant: PlacesPlant, point: ModelPoint, played: Played, laws: Sequence[Law]
) -> Singles:
    """Responses to all terms of all laws in one run, (terms, bins, channels)."""
    run, places = played.run, {place.name: place for place in plant.places}
    states = plant.trajectory(point, run, fast=True)

    def readings(forcing: Forcing) -> Array:
        return played.on_grid(plant.forced(point, run, forcing, fast=True), plant.channels)

    def changed(key: tuple[str, str], series: Array) -> Array:
        try:
            moved = readings({key: series})
        except PlantError:
            return np.zeros_like(base)
        return moved - base if finite([moved]) else np.zeros_like(base)

    base = readings({})
    out = np.zeros((sum(len(law.terms) for law in laws), *base.shape), dtype=np.float32)
    first = 0
    for law in laws:
        place, key = places[law.place], (law.place, law.side)
        X = law_values(plant, law, states, run.t_s)
        # Values at a sample are in force over the sample that follows, but a bare plant is pushed
        # by what its inputs are at that very sample (`BarePlaces`).
        at_once = place.reading or isinstance(plant, BarePlaces)
        forcing = place.scale * (X if at_once else np.concatenate([X[:1], X[:-1]]))
        span = slice(first, first := first + len(law.terms))
        if place.reading:
            # The response to a constant of 1 there.
            share = np.median(readings({key: np.ones(len(forcing))}) - base, axis=0)
            out[span] = played.means(forcing.T)[:, :, None] * share
        else:
            together = traits_of(plant).together
            out[span] = np.array(each(partial(changed, key), forcing.T, together))
    return out
