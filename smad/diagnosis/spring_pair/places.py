"""Places of the spring pair as the diagnosis sees them: channels and units of the run log."""

from __future__ import annotations

from sim_device.plant.errors import InputError
from sim_device.plant.laws import unit_of_state
from sim_device.plant.places import PLACES, STATES, check_place_needs
from smad.diagnosis.places.place import Place

# Output of the plant -> channel of the run log, and what one SI unit is there.
_CHANNELS = {
    "i_x_A": ("i_meas_x_A", 1.0),
    "i_y_A": ("i_meas_y_A", 1.0),
    "displacement_m": ("displacement_mm", 1e3),
}


def places_of_pair(variant: str) -> tuple[Place, ...]:
    """Those that the pair has in a variant, water cooled."""
    options = {"variant": variant, "fixture": "antagonistic", "cooling": "water"}
    found = []
    for entry in PLACES:
        try:
            check_place_needs(entry.name, options)
        except InputError:
            continue
        channels = {
            side: tuple(_CHANNELS.get(c, (c, 1.0))[0] for c in entry.channels_of(side))
            for side in entry.sides
        }
        gain = _CHANNELS.get(entry.channels[0].replace("{side}", "x"), ("", 1.0))[1]
        found.append(
            Place(
                name=entry.name,
                label=entry.label,
                unit=entry.unit,
                scale=entry.scale,
                sides=entry.sides,
                states=entry.states,
                channels=channels,
                reading=entry.reading,
                gain=gain if entry.reading else 1.0,
            )
        )
    return tuple(found)


def state_words(place: str, state: str) -> tuple[str, str]:
    """A state in words, and its unit at a place."""
    label = next(s.label for s in STATES if s.name == state)
    return label, unit_of_state(place, state)
