"""Where a plant's model can be wrong: its places, and replays that are forced there.

Optional for a plant. One that offers none has its readings as places all the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from smad.gap.errors import GapError
from smad.gap.plant import Array, ModelPoint, PlantModel
from smad.gap.runs import GapRun

BOTH = "both"
Forcing = Mapping[tuple[str, str], Array]
"""One series, shape (n,), for each (place, side), in the unit of the place."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place where an equation of a model can be wrong.

    unit: of the forcing. scale: a typical size in it. sides: single ones that can be forced.
    states: those that a law here may depend on. channels: measured channels that it touches
    directly, by side. reading: the forcing adds to one channel and nothing else, times `gain` in
    that channel's unit, so that its response needs no replay.
    """

    name: str
    label: str
    unit: str
    scale: float
    sides: tuple[str, ...]
    states: tuple[str, ...]
    channels: Mapping[str, tuple[str, ...]]
    reading: bool = False
    gain: float = 1.0


@runtime_checkable
class Forceable(Protocol):
    """What a plant has beside, if its model can be forced."""

    @property
    def places(self) -> Sequence[Place]: ...

    def trajectory(
        self, point: ModelPoint, run: GapRun, *, fast: bool = False
    ) -> Mapping[str, Array]:
        """Every state that a law may depend on, shape (n,) each, of the run replayed unforced."""
        ...

    def forced(
        self, point: ModelPoint, run: GapRun, forcing: Forcing, *, fast: bool = False
    ) -> dict[str, Array]:
        """Channels of the run replayed in open loop under a forcing, by channel, in its unit.

        Row k is in force over the sample that ends at t_s[k], or in the reading of t_s[k]. `fast`
        allows longer steps.
        """
        ...


def places_of(plant: PlantModel) -> Sequence[Place]:
    """The places of a plant; its readings where it offers none."""
    if isinstance(plant, Forceable):
        return plant.places
    return tuple(
        Place(
            name=f"reading_{c.name}",
            label=f"reading of {c.name}",
            unit=c.unit,
            scale=max(c.quantum, c.noise, 1e-3 * (c.high - c.low)),
            sides=(BOTH,),
            states=(*(signal.name for signal in plant.inputs), "time", "reading", "reading_rate"),
            channels={BOTH: (c.name,)},
            reading=True,
        )
        for c in plant.channels
    )


def forced_run(
    plant: PlantModel, point: ModelPoint, run: GapRun, forcing: Forcing
) -> dict[str, Array]:
    """Channels of a run under a forcing, whatever the plant: of readings by adding it.

    Raises GapError for a place that the plant does not have.
    """
    if isinstance(plant, Forceable):
        return plant.forced(point, run, forcing)
    open_loop = next(view for view in plant.views if view.open_loop)
    predicted = plant.simulate(point, run, [open_loop.name])
    out = {o.channel: predicted[o.key] for o in open_loop.outputs}
    known = {place.name: place for place in places_of(plant)}
    for (name, side), series in forcing.items():
        if name not in known or side not in known[name].sides:
            raise GapError(
                "the plant has no such place",
                value=f"{name}, side {side}",
                limit=", ".join(known),
                action="force one of its places",
            )
        (channel,) = known[name].channels[side]
        out[channel] = out[channel] + known[name].gain * series
    return out
