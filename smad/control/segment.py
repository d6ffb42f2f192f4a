"""MINIR-II end segment: degrees as a unit of displacement."""

from smad.config import axes

DEGREES_PER_MM = axes.DEGREES_PER_MM
"""±4 mm of the springs turn the segment by ±25°; the parameter sets hold it as `robot_gain`."""


def millimetres(angle_deg: float) -> float:
    """Displacement, mm, that turns the segment by `angle_deg`."""
    return angle_deg / DEGREES_PER_MM
