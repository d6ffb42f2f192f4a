"""Places: where an equation of the model can be wrong, one table for plant, diagnosis and docs.

A *forcing* is one series for a place and a side: it stands in the equation as an added heat, a
share of the flow, a shift. A *law* (`sim_device.plant.laws`) makes it from the plant's own states.
"""

from __future__ import annotations

from dataclasses import dataclass

from sim_device.plant.errors import InputError

BOTH = "both"
SPRINGS = ("x", "y")
SHARED = (BOTH,)

_OWN = (
    "wire", "water", "current", "duty", "fraction", "force", "displacement", "velocity",
    "wire_rate", "fraction_rate", "other_wire", "other_duty", "time", "transformed",
)  # fmt: skip
_OF_BOTH = (*_OWN, "other_current", "other_fraction")
_READ = ("reading", "reading_rate")


@dataclass(frozen=True, kw_only=True)
class State:
    """A state that a law may depend on, as one spring sees it."""

    name: str
    unit: str
    label: str


STATES: tuple[State, ...] = (
    State(name="wire", unit="K", label="temperature of its wire"),
    State(name="water", unit="K", label="temperature of its water"),
    State(name="current", unit="A", label="its current"),
    State(name="duty", unit="1", label="duty of its pump"),
    State(name="fraction", unit="1", label="its martensite fraction"),
    State(name="force", unit="N", label="its tension"),
    State(name="displacement", unit="m", label="displacement, as its own contraction"),
    State(name="velocity", unit="m/s", label="velocity, of its own contraction"),
    State(name="wire_rate", unit="K/s", label="rate of its wire's temperature"),
    State(name="fraction_rate", unit="1/s", label="rate of its martensite fraction"),
    State(name="other_wire", unit="K", label="temperature of the other wire"),
    State(name="other_duty", unit="1", label="duty of the other pump"),
    State(name="time", unit="s", label="time since the start"),
    State(name="transformed", unit="1", label="transformation cycles so far"),
    State(name="other_current", unit="A", label="the other current"),
    State(name="other_fraction", unit="1", label="the other martensite fraction"),
    State(name="reading", unit="", label="what the channel itself reads"),
    State(name="reading_rate", unit="", label="rate of what the channel reads"),
)
"""The order is the kernel's (`kernel.forcing`). Those of both sides are seen from spring X. The
displacement of Y is its own contraction, minus what the encoder reads. Units of the last two are
the channel's."""
STATE_NAMES: tuple[str, ...] = tuple(state.name for state in STATES)


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place in the equations of the pair.

    name: stable, in files. label: in words. unit: SI unit of the forcing; for a reading that of the
    channel in the kernel (K, not °C). scale: a typical size in it. sides: ("x", "y") where each
    spring has its own, else ("both",). states: those that a law here may depend on. channels: plant
    outputs that it touches directly, "{side}" standing for the spring. reading: the forcing adds to
    one channel and nothing else, so that no replay is needed. needs: options without which nothing
    is forced here, as of an effect.
    """

    name: str
    label: str
    unit: str
    scale: float
    sides: tuple[str, ...]
    states: tuple[str, ...]
    channels: tuple[str, ...]
    reading: bool = False
    needs: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def channels_of(self, side: str) -> tuple[str, ...]:
        """Outputs of a replay that the place touches directly on a side."""
        sides = SPRINGS if side == BOTH else (side,)
        return tuple(dict.fromkeys(c.replace("{side}", s) for c in self.channels for s in sides))


def _spring(
    name: str,
    label: str,
    unit: str,
    scale: float,
    *channels: str,
    needs: tuple[tuple[str, tuple[str, ...]], ...] = (),
) -> Place:
    return Place(
        name=name,
        label=label,
        unit=unit,
        scale=scale,
        sides=SPRINGS,
        states=_OWN,
        channels=channels,
        needs=needs,
    )


def _pair(name: str, label: str, unit: str, scale: float, *channels: str) -> Place:
    return Place(
        name=name,
        label=label,
        unit=unit,
        scale=scale,
        sides=SHARED,
        states=_OF_BOTH,
        channels=channels,
    )


def _reading(name: str, label: str, unit: str, scale: float, channel: str) -> Place:
    sided = "{side}" in channel
    return Place(
        name=name,
        label=label,
        unit=unit,
        scale=scale,
        sides=SPRINGS if sided else SHARED,
        states=(*(_OWN if sided else _OF_BOTH), *_READ),
        channels=(channel,),
        reading=True,
    )


_WET = (("cooling", ("water",)),)
_NODE = (*_WET, ("variant", ("extended",)))
_RTD, _MOVES = "rtd_{side}_degC", ("displacement_m", "force_N")

PLACES: tuple[Place, ...] = (
    _spring("heat_into_wire", "heat into the wire", "W", 0.5, _RTD),
    _spring("heat_into_water", "heat into the water", "W", 0.5, _RTD, needs=_NODE),
    _spring("film", "film between wire and water (share of it)", "1", 0.2, _RTD),
    _spring(
        "flow_before_pump", "flow asked of the pump (share of full flow)", "1", 0.1, _RTD,
        needs=_WET,
    ),
    _spring(
        "flow_behind_pump", "flow behind the pump (share of full flow)", "1", 0.1, _RTD,
        needs=_WET,
    ),
    _spring("transformation_shift", "shift of the transformation temperatures", "K", 1.0, *_MOVES),
    _spring("recoverable_strain", "recoverable strain (as deflection)", "m", 5e-4, *_MOVES),
    _spring(
        "driven_current", "current that the driver makes", "A", 0.1, "i_{side}_A", "v_{side}_V"
    ),
    _spring("resistance", "resistance (share of it)", "1", 0.05, "v_{side}_V"),
    _pair("force_cell_on_x", "force between the springs, force cell beside X", "N", 0.05, *_MOVES),
    _pair("force_cell_on_y", "force between the springs, force cell beside Y", "N", 0.05, *_MOVES),
    _pair("inlet_water", "temperature of the inlet water", "K", 1.0, "rtd_inlet_degC"),
    _pair("ambient_air", "temperature of the room", "K", 1.0, "rtd_ambient_degC"),
    _reading("reading_current", "reading of the current", "A", 0.02, "i_{side}_A"),
    _reading("reading_voltage", "reading of the voltage", "V", 0.02, "v_{side}_V"),
    _reading("reading_rtd", "reading of the RTD", "K", 0.5, _RTD),
    _reading("reading_inlet", "reading of the inlet's RTD", "K", 0.5, "rtd_inlet_degC"),
    _reading("reading_ambient", "reading of the room's RTD", "K", 0.5, "rtd_ambient_degC"),
    _reading("reading_displacement", "reading of the encoder", "m", 1e-4, "displacement_m"),
    _reading("reading_force", "reading of the force cell", "N", 0.05, "force_N"),
)  # fmt: skip
_BY_NAME = {place.name: place for place in PLACES}

Key = tuple[str, str]
"""(place, side)."""
SLOTS: dict[Key, int] = {
    key: slot
    for slot, key in enumerate((place.name, side) for place in PLACES for side in place.sides)
}
"""Where the kernel keeps the forcing of a place and side."""


def place(name: str) -> Place:
    """The entry of that name; InputError names the known ones otherwise."""
    try:
        return _BY_NAME[name]
    except (KeyError, TypeError):
        names = ", ".join(_BY_NAME)
        raise InputError(f"place {name!r} is unknown; known are {names}") from None


def keys_of(name: str, side: str) -> tuple[Key, ...]:
    """The single sides of a place that a side stands for: "both" of two springs is each of them.

    Raises InputError for an unknown place or side.
    """
    entry = place(name)
    if side in entry.sides:
        return ((name, side),)
    if side == BOTH:
        return tuple((name, each) for each in entry.sides)
    allowed = ", ".join(dict.fromkeys((*entry.sides, BOTH)))
    raise InputError(f"place {name} has no side {side!r}; give one of {allowed}")


def check_place_needs(name: str, options: dict[str, str]) -> None:
    """Raise InputError where the plant with these options has no such place."""
    for option, allowed in place(name).needs:
        if options[option] not in allowed:
            raise InputError(
                f"place {name} needs {option} {' or '.join(allowed)}, the plant has"
                f" {options[option]}; leave it out or change the {option}"
            )
