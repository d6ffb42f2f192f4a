"""Where this plant departs from the nominal model of docs/physics.md, effects and constants apart.

Derived from the equations of the two, not from what a diagnosis says. Constants of a bench differ
as well, but those are parameters of the nominal model.
"""

from typing import TypedDict

from evaluation.plant.effect import FLOW

_OWN = (
    ("transformation_shift recoverable_strain",
     "a Preisach operator of six plays with its own curves in place of the cosine laws: wider on "
     "heating than on cooling, minor loops, no reset at a reversal (phase.martensite)"),
    ("transformation_shift",
     "stress lifts the cooling curve only beyond the onset of turning, and by another slope than "
     "the heating curve (phase.cooling_shift)"),
    ("recoverable_strain",
     "stress turns martensite by a Weibull law in the excess over an onset; what was turned stays "
     "turned until it is formed anew; springs act in cells in series (phase.turned_by, mechanics)"),
    ("film",
     "still film as a power of the temperature step and forced film as the root of the flow, added "
     "as cubes, in place of Churchill–Chu and a cross-flow law, the larger of which counts"),
    (f"heat_into_water heat_into_wire reading_rtd {FLOW}",
     "six cells with flow from inlet to outlet and mixing, in place of one stirred volume: the "
     "water leaves warmer than its mean, wire and RTD are not at the mean temperature"),
    ("heat_into_water",
     "loss to the room as a power 1.12 of the temperature step, in place of a conductance"),
    ("heat_into_wire",
     "one heat capacity and one latent heat, the same for heating and cooling"),
)  # fmt: skip


class Difference(TypedDict):
    """The places that can hold a difference, and what it is."""

    places: list[str]
    what: str


def own_differences() -> list[Difference]:
    """The plant's own differences."""
    return [Difference(places=codes.split(), what=what) for codes, what in _OWN]
