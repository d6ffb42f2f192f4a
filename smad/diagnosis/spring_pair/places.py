"""Places of the spring pair as the diagnosis sees them."""

from __future__ import annotations

import contextlib

from sim_device.plant.errors import InputError
from sim_device.plant.laws import unit_of_state
from sim_device.plant.places import PLACES, STATES, check_place_needs
from smad.diagnosis.places.place import Place


def places_of_pair(variant: str) -> tuple[Place, ...]:
    """Those that the pair has in a variant, water cooled."""
    options = {"variant": variant, "fixture": "antagonistic", "cooling": "water"}
    found = []
    for entry in PLACES:
        with contextlib.suppress(InputError):
            check_place_needs(entry.name, options)
            found.append(
                Place(
                    name=entry.name, label=entry.label, unit=entry.unit, scale=entry.scale,
                    sides=entry.sides, states=entry.states, reading=entry.reading,
                )
            )  # fmt: skip
    return tuple(found)


def state_words(place: str, state: str) -> tuple[str, str]:
    """A state in words, and its unit at a place."""
    label = next(s.label for s in STATES if s.name == state)
    return label, unit_of_state(place, state)
