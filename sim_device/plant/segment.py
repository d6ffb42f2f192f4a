"""MINIR-II end segment: its angle from the tendon's displacement, and back."""

from __future__ import annotations

from sim_device.plant.parameters import ParameterSet


def segment_angle_deg(displacement_m: float, parameters: ParameterSet) -> float:
    """Angle of the end segment, degrees; paper section 6: ±4 mm for about ±25°."""
    return parameters["robot_gain"] * displacement_m


def segment_displacement_m(angle_deg: float, parameters: ParameterSet) -> float:
    """Displacement that gives an angle of the end segment, m."""
    return angle_deg / parameters["robot_gain"]
