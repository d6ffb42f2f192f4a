"""Where a plant's model can be wrong: its places, and replays that are forced there.

Optional for a plant: one without places gets its readings and inputs as places
(`smad.diagnosis.places.bare`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from sim_device.plant import Law, basis
from smad.diagnosis.plant import Array, ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun

BOTH = "both"
Forcing = Mapping[tuple[str, str], Array]
"""One series, shape (n,), for each (place, side), in the unit of the place."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place where an equation of a model can be wrong.

    unit: of the forcing. scale: a typical size in it. sides: single ones that can be forced.
    states: those that a law here may depend on. reading: the forcing adds to one channel and
    nothing else, so that one replay gives the response to any forcing.
    """

    name: str
    label: str
    unit: str
    scale: float
    sides: tuple[str, ...]
    states: tuple[str, ...]
    reading: bool = False


@runtime_checkable
class Forceable(Protocol):
    """What a plant offers if its model can be forced."""

    @property
    def places(self) -> Sequence[Place]: ...

    def trajectory(
        self, point: ModelPoint, run: GapRun, *, fast: bool = False
    ) -> Mapping[str, Array]:
        """Every state that a law may depend on, shape (n,) each, of the run replayed unforced."""
        ...

    def seen(self, place: str, side: str, states: Mapping[str, Array]) -> dict[str, Array]:
        """The states of a trajectory as a place sees them on one side, by the name of a state."""
        ...

    def state_words(self, place: str, state: str) -> tuple[str, str]:
        """A state of a place in words, and its unit."""
        ...

    def forced(
        self, point: ModelPoint, run: GapRun, forcing: Forcing, *, fast: bool = False
    ) -> dict[str, Array]:
        """Channels of the run replayed in open loop under a forcing, by channel, in its unit.

        Row k is in force over the sample that ends at t_s[k], or in the reading of t_s[k]. `fast`
        allows longer steps.
        """
        ...


class PlacesPlant(PlantModel, Forceable, Protocol):
    """A plant whose model can be forced."""


def place_named(plant: Forceable, name: str) -> Place:
    """The place of that name. Raises StopIteration where the plant has none."""
    return next(p for p in plant.places if p.name == name)


def states_seen(
    plant: Forceable, place: str, side: str, states: Mapping[str, Array]
) -> dict[str, Array]:
    """States of a trajectory, (n,) each, as the place sees them on `side`, or on its first side if
    that is "both"."""
    sides = place_named(plant, place).sides
    return plant.seen(place, side if side in sides else sides[0], states)


def law_values(plant: Forceable, law: Law, states: Mapping[str, Array], t_s: Array) -> Array:
    """Basis functions of a law's terms on a trajectory, (n, k), as its first side sees it."""
    return basis(states_seen(plant, law.place, law.side, states), law.terms, t_s)


def law_series(plant: Forceable, law: Law, states: Mapping[str, Array], t_s: Array) -> Array:
    """Values of a law on a trajectory, (n,), in the unit of the place."""
    X = law_values(plant, law, states, t_s)
    return np.asarray(X @ np.array([t.coefficient for t in law.terms]))
