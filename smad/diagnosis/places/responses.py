"""Responses: what a plant's readings show of each term of the law space at each place.

Computed once at a reference point. A term's forcing is its function of the *reference* trajectory's
states, so that responses are linear in a law's coefficients. At a reading the forcing adds to one
channel, and one replay tells how; every other place costs a replay a term.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim_device.plant.errors import PlantError
from sim_device.plant.laws import Law, Term, as_forcing, design_matrix, law_space, support_of
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.search.where import Candidate
from smad.gap.paired.model import Played, finite
from smad.gap.paired.rows import bin_numbers
from smad.gap.places import BOTH, Forceable, Forcing
from smad.gap.plant import ModelPoint, PlantModel

_SHRINK = 4.0
"""Prior precision of a term for each order above the first."""


class PlacesPlant(PlantModel, Forceable, Protocol):
    """A plant whose equations can be forced."""


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Responses of every term. `laws` have the terms of each place and single side, `columns` where
    they stand; `runs` has one array a run, (terms, bins, channels), a term at the place's scale."""

    laws: tuple[Law, ...]
    columns: tuple[range, ...]
    runs: tuple[Array, ...]

    def candidates(self) -> list[Candidate]:
        """Each place on each of its sides, and on both where it has two."""
        out = [
            _candidate(law, np.asarray(c)) for law, c in zip(self.laws, self.columns, strict=True)
        ]
        by_place: dict[str, list[Candidate]] = {}
        for candidate in out:
            by_place.setdefault(candidate.place, []).append(candidate)
        for name, sides in by_place.items():
            if len(sides) > 1:
                columns = np.concatenate([s.columns for s in sides])
                precision = np.concatenate([s.precision for s in sides])
                out.append(Candidate(name, BOTH, columns, precision))
        return out


def _candidate(law: Law, columns: Array) -> Candidate:
    order = np.array([term.order for term in law.terms])
    return Candidate(law.place, law.side, columns.astype(np.intp), _SHRINK ** (order - 1.0))


def responses(
    plant: PlacesPlant,
    point: ModelPoint,
    runs: Sequence[Played],
    *,
    space: Callable[..., tuple[Term, ...]] = law_space,
    progress: Callable[[str], None] = lambda text: None,
) -> Responses:
    """Responses of all places at `point`. Terms that the model cannot replay have response 0."""
    states = [plant.trajectory(point, p.run, fast=True) for p in runs]
    replayed = [_Replayed(plant, point, p) for p in runs]
    bases = [r.readings({}) for r in replayed]
    laws: list[Law] = []
    columns: list[range] = []
    found: list[list[Array]] = [[] for _ in runs]
    count = 0
    for place in plant.places:
        for side in place.sides:
            progress(f"responses: {place.label} {side}")
            terms = space(place.name, side, support_of(place.name, side, states))
            laws.append(Law(place.name, side, terms))
            columns.append(range(count, count + len(terms)))
            count += len(terms)
            for own, r, s, base in zip(found, replayed, states, bases, strict=True):
                X = design_matrix(place.name, side, s, terms, r.played.run.t_s)
                forcing = place.scale * as_forcing(place.name, X)
                of = r.of_reading if place.reading else r.of_place
                own.append(of((place.name, side), forcing, base))
    return Responses(
        laws=tuple(laws), columns=tuple(columns), runs=tuple(np.concatenate(f) for f in found)
    )


@dataclass(frozen=True)
class _Replayed:
    """One run at the reference point, and what forcings change of it."""

    plant: PlacesPlant
    point: ModelPoint
    played: Played

    def readings(self, forcing: Forcing) -> Array:
        """The forced prediction on the grid, (bins, channels)."""
        outputs = self.plant.forced(self.point, self.played.run, forcing, fast=True)
        series = np.stack([outputs[c.name] for c in self.plant.channels])
        return _means(series, self.played).T

    def of_place(self, key: tuple[str, str], forcing: Array, base: Array) -> Array:
        """What each column of `forcing` (n, k) changes, (k, bins, channels), a replay for each."""
        out = np.zeros((forcing.shape[1], *base.shape), dtype=np.float32)
        for k, series in enumerate(forcing.T):
            try:
                moved = self.readings({key: series})
            except PlantError:
                continue
            if finite([moved]):
                out[k] = moved - base
        return out

    def of_reading(self, key: tuple[str, str], forcing: Array, base: Array) -> Array:
        """The same for a place of a reading, by what a constant of 1 does there."""
        share = np.median(self.readings({key: np.ones(len(forcing))}) - base, axis=0)
        means = _means(forcing.T, self.played)
        return np.asarray(means[:, :, None] * share, dtype=np.float32)


def _means(series: Array, played: Played) -> Array:
    """Means of series (m, n) in each bin, (m, bins)."""
    at = bin_numbers(played.run, played.start_s)
    inside = (at >= 0) & (at < played.bins)
    count = np.maximum(np.bincount(at[inside], minlength=played.bins), 1)
    return np.array(
        [np.bincount(at[inside], s[inside], minlength=played.bins) / count for s in series]
    )
