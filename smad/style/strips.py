"""The one table of what the page draws: channels, the strips it begins with, units and limits.

Pure. A page gets both as they are. `STRIPS` is also what the log's page, the terminal and the
layouts of other viewers show; a live page shows any of `CHANNELS` in any strip.
"""

import re
from collections.abc import Mapping
from operator import attrgetter

from msgspec import Struct

from smad.api import Telemetry
from smad.config import Config
from smad.runlog import schema
from smad.units import in_words


class Curve(Struct, frozen=True):
    """A column of the telemetry; `pen` says which colour and line of the style sheet it has."""

    column: str
    label: str
    pen: str


class PlotAxis(Struct, frozen=True, kw_only=True):
    """What the axis of a plot shows. `scale` multiplies what the telemetry says.

    `limit` is the key of the configuration that bounds it, `both_ways` whether -limit does too.
    """

    title: str
    unit: str
    digits: int
    scale: float = 1.0
    limit: str = ""
    both_ways: bool = False


class Strip(PlotAxis, frozen=True, kw_only=True):
    """A plot with an axis of its own; `least` and `most` are what that shows at least."""

    name: str
    curves: tuple[Curve, ...]
    least: float | None = None
    most: float | None = None
    on_demand: bool = False


def _pair(column: str) -> tuple[Curve, Curve]:
    return (
        Curve(column.format("x"), "X", "x"),
        Curve(column.format("y"), "Y", "y"),
    )


STRIPS = (
    Strip(
        name="displacement",
        title="Displacement",
        unit="mm",
        digits=2,
        curves=(
            Curve("displacement_mm", "measured", "main"),
            Curve("reference_mm", "reference", "reference"),
        ),
        limit="limits.displacement_max_mm",
        both_ways=True,
    ),
    Strip(
        name="force",
        title="Tendon force",
        unit="N",
        digits=2,
        curves=(Curve("force_N", "measured", "main"),),
        limit="limits.force_max_N",
        least=0.0,
    ),
    Strip(
        name="temperature",
        title="Spring temperature",
        unit="°C",
        digits=1,
        curves=(*_pair("rtd_{}_degC"), Curve("reference_degC", "reference", "reference")),
        limit="limits.temperature_max_degC",
        least=20.0,
    ),
    Strip(
        name="current",
        title="Current",
        unit="A",
        digits=2,
        curves=_pair("i_meas_{}_A"),
        limit="control.current_limit_A",
        least=0.0,
    ),
    Strip(
        name="pump",
        title="Pump duty",
        unit="%",
        digits=0,
        curves=_pair("duty_{}"),
        scale=100.0,
        least=0.0,
        most=100.0,
    ),
    Strip(
        name="voltage",
        title="Spring voltage",
        unit="V",
        digits=2,
        curves=_pair("v_{}_V"),
        least=0.0,
        on_demand=True,
    ),
)


class Channel(PlotAxis, frozen=True, kw_only=True):
    """A channel as the live page draws it: `title` says what, `label` which of several.

    `span`: the axis always shows this.
    """

    name: str
    label: str
    pen: str
    span: tuple[float, float] | None = None


NO_QUANTITY = frozenset({"t_s", "host_time_s", "tick", "faults", "warnings", "valid"})
"""Channels of the log that are times, counters of samples or bits: no curve says anything."""
_DIGITS = {"degC": 1, "deg": 1}
"""After the point, where they are not two."""


def _of_strip(strip: Strip, curve: Curve) -> Channel:
    fixed = strip.least is not None and strip.most is not None
    return Channel(
        name=curve.column,
        label=curve.label,
        pen=curve.pen,
        span=(strip.least, strip.most) if fixed else None,  # type: ignore[arg-type]
        **{name: getattr(strip, name) for name in PlotAxis.__struct_fields__},
    )


_TITLES = {
    "i_cmd_A": "Current commanded",
    "i_applied_A": "Current setpoint on the board",
    "pump_starts": "Pump starts",
    "drain": "Drain valve",
    "rtd_inlet_degC": "Temperature of the water inlet",
    "rtd_ambient_degC": "Temperature of the room",
    "angle_deg": "Angle of the segment",
    "supply_V": "Supply voltage",
    "stage_mm": "Position of the stage",
    "mode": "Number of the board's state",
    "limiter": "Number of the board's limiter",
    "setpoint_age_ms": "Age of the setpoint",
}
"""Channels that are on no strip, by name without _x and _y: their titles."""


def in_no_strip(spec: schema.ChannelSpec) -> Channel:
    """Return how a channel of the log is drawn that no strip begins with."""
    side = re.search(r"_([xy])(?=_|$)", spec.name)
    spring = side[1].upper() if side else ""
    stem = spec.name.replace(side[0], "", 1) if side else spec.name
    usual = spec.description.partition(", ")[0]
    return Channel(
        name=spec.name,
        title=_TITLES.get(stem, f"{usual[0].upper()}{usual[1:]}"),
        label=spring or "measured",
        unit=in_words(spec.unit),
        digits=_DIGITS.get(spec.unit, 2) if spec.kind == "float" else 0,
        pen=spring.lower() or "main",
    )


_OF_STRIPS = {curve.column: _of_strip(strip, curve) for strip in STRIPS for curve in strip.curves}
CHANNELS = tuple(
    _OF_STRIPS.get(name) or in_no_strip(spec)
    for name, spec in schema.CHANNELS.items()
    if name not in NO_QUANTITY
)
PLACES: Mapping[str, int] = {channel.name: place for place, channel in enumerate(CHANNELS)}
"""Where each channel stands in `values`."""
MOTION = PLACES["displacement_mm"]
LAYOUT = tuple(
    tuple(curve.column for curve in strip.curves) for strip in STRIPS if not strip.on_demand
)
"""The strips that a page begins with, by their channels."""
XY_LAYOUT = (("rtd_x_degC", "displacement_mm"), ("displacement_mm", "force_N"))
"""The XY plots that a page begins with, by what goes right and what goes up."""

_of_columns = attrgetter(*PLACES)


def values(sample: Telemetry) -> tuple[float | None, ...]:
    """Return what the page may draw of a sample, in the order of CHANNELS."""
    taken: tuple[float | None, ...] = _of_columns(sample)
    return taken


def limits(config: Config) -> Mapping[str, float]:
    """Return the host's limit of each channel that has one; the daemon ends a motion there."""
    return {
        channel.name: attrgetter(channel.limit)(config) for channel in CHANNELS if channel.limit
    }
