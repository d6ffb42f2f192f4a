"""An axis of a bench that has several, and the segments of a robot on them."""

from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta

from smad.config.section import HOST, Section, about, above
from smad.errors import ConfigError

DEGREES_PER_MM = 6.25
"""Of the end segment of MINIR-II: ±4 mm of the springs turn it by ±25°. The parameter sets hold it
as `robot_gain`."""

USUAL_NAMES = ("pitch-1", "yaw-1", "pitch-2", "yaw-2", "pitch-3", "yaw-3")
"""Three segments, from the base to the tip, each with an axis for pitch and one for yaw."""

SMALLEST_PIVOT = 1e-6
"""Of a coupling that has an inverse."""

_Gain = Annotated[float, Meta(ge=0.0, le=1000.0)]


def millimetres(angle_deg: float) -> float:
    """Displacement, mm, that turns the segment by `angle_deg`."""
    return angle_deg / DEGREES_PER_MM


class AxisConfig(Section, frozen=True, kw_only=True):
    """An axis of a bench that has several; a key left out has the value of the bench."""

    name: Annotated[
        str, Meta(pattern=r"^[A-Za-z0-9_-]{1,32}\Z", description="what the axis is called")
    ]
    port: Annotated[str, about("device of its board, best /dev/serial/by-id/…")] = ""
    rate_hz: Annotated[Literal[100, 250, 500] | None, about("samples per second; link.rate_hz")] = (
        None
    )
    kp_A_per_mm: Annotated[_Gain | None, about("proportional gain; control.kp_A_per_mm")] = None
    ki_A_per_mm_s: Annotated[_Gain | None, about("integral gain; control.ki_A_per_mm_s")] = None
    current_limit_A: Annotated[
        Annotated[float, Meta(ge=0.0, le=HOST.current_mA / 1000)] | None,
        about("largest current in a spring; control.current_limit_A"),
    ] = None
    travel_mm: Annotated[
        Annotated[float, Meta(ge=0.1, le=50.0)] | None,
        about("travel of the tendon either way; limits.displacement_max_mm"),
    ] = None
    temperature_max_degC: Annotated[
        Annotated[float, Meta(ge=30.0, le=HOST.temperature_cC / 100)] | None,
        about("hottest spring; limits.temperature_max_degC"),
    ] = None
    coupling: Annotated[
        tuple[Annotated[float, Meta(ge=-10.0, le=10.0)], ...],
        about("travel of this tendon for 1 mm of each axis in order; empty: its own"),
    ] = ()
    fault_holds: Annotated[
        Literal["all", "own"], about("what a fault, a limit or a lost link of this axis stops")
    ] = "all"


OF_THE_BENCH = {
    "port": ("link", "port"),
    "rate_hz": ("link", "rate_hz"),
    "kp_A_per_mm": ("control", "kp_A_per_mm"),
    "ki_A_per_mm_s": ("control", "ki_A_per_mm_s"),
    "current_limit_A": ("control", "current_limit_A"),
    "travel_mm": ("limits", "displacement_max_mm"),
    "temperature_max_degC": ("limits", "temperature_max_degC"),
}
"""Key of an axis -> section and key of the bench that it stands for."""


class SegmentConfig(Section, frozen=True, kw_only=True):
    """A segment of a robot: two joint angles from two axes."""

    name: Annotated[
        str, Meta(pattern=r"^[A-Za-z0-9_-]{1,32}\Z", description="what the segment is called")
    ]
    pitch: Annotated[str, Meta(min_length=1, description="axis that turns it up and down")]
    yaw: Annotated[str, Meta(min_length=1, description="axis that turns it to the sides")]
    gain_deg_per_mm: Annotated[float, above(0.0, 1000.0, "angle for 1 mm of the tendon")] = (
        DEGREES_PER_MM
    )
    limit_deg: Annotated[float, above(0.0, 180.0, "largest angle of either joint, either way")] = (
        25.0
    )
    pitch_sign: Annotated[
        Literal[1, -1], about("sign of the angle for a positive displacement")
    ] = 1
    yaw_sign: Annotated[Literal[1, -1], about("sign of the angle for a positive displacement")] = 1


def coupling_of(axes: Sequence[AxisConfig]) -> list[list[float]]:
    """Return the travel of each tendon for 1 mm of each axis, a row a tendon.

    Raises ConfigError for a row that has not a number for each axis.
    """
    rows = []
    for k, axis in enumerate(axes):
        if axis.coupling and len(axis.coupling) != len(axes):
            raise ConfigError(
                f"the coupling of {axis.name} needs one number for each axis",
                value=len(axis.coupling),
                limit=len(axes),
                action="correct it in [[axes]]",
            )
        rows.append(list(axis.coupling) or [float(k == j) for j in range(len(axes))])
    return rows


def inverse(coupling: Sequence[Sequence[float]]) -> list[list[float]]:
    """Return the inverse of a coupling. Raises ConfigError where there is none."""
    n = len(coupling)
    rows = [[*row, *(float(k == j) for j in range(n))] for k, row in enumerate(coupling)]
    for k in range(n):
        best = max(range(k, n), key=lambda j: abs(rows[j][k]))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k][k]
        if abs(pivot) < SMALLEST_PIVOT:
            raise ConfigError(
                "the coupling of the axes has no inverse",
                value=f"pivot {pivot:.3g}",
                limit=f"at least {SMALLEST_PIVOT:g}",
                action="correct `coupling` in [[axes]]",
            )
        rows[k] = [value / pivot for value in rows[k]]
        for j in range(n):
            if j != k and rows[j][k] != 0.0:
                factor = rows[j][k]
                rows[j] = [a - factor * b for a, b in zip(rows[j], rows[k], strict=True)]
    return [row[n:] for row in rows]
