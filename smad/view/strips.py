"""The one table of what the page draws: strips, their curves, units and limits.

Pure. A page gets it as it is; the columns of a frame are `COLUMNS`, in this order.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter

from msgspec import Struct

from smad.api import Telemetry
from smad.config import Config


class Curve(Struct, frozen=True):
    """A column of the telemetry; `pen` says which colour and line of the style sheet it has."""

    column: str
    label: str
    pen: str


class Strip(Struct, frozen=True, kw_only=True):
    """A plot with an axis of its own. `scale` multiplies what the telemetry says.

    `limit` is the key of the configuration that bounds it, `both_ways` whether -limit does too;
    `least` and `most` are what the axis shows at least.
    """

    name: str
    title: str
    unit: str
    digits: int
    curves: tuple[Curve, ...]
    scale: float = 1.0
    limit: str = ""
    both_ways: bool = False
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
        title="Temperature of the springs",
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
        title="Voltage across the springs",
        unit="V",
        digits=2,
        curves=_pair("v_{}_V"),
        least=0.0,
        on_demand=True,
    ),
)

COLUMNS = tuple(curve.column for strip in STRIPS for curve in strip.curves)

_of_columns = attrgetter(*COLUMNS)


def values(sample: Telemetry) -> tuple[float | None, ...]:
    """Return what the page draws of a sample, in the order of COLUMNS."""
    taken: tuple[float | None, ...] = _of_columns(sample)
    return taken


def limits(config: Config) -> Mapping[str, float]:
    """Return the host's limit of each strip that has one; the daemon ends a motion there."""
    return {strip.name: attrgetter(strip.limit)(config) for strip in STRIPS if strip.limit}
