"""A robot on a bench of several axes: joint angles of its segments, in place of millimetres."""

from smad.robot.angles import Angles, circle, step, waypoints
from smad.robot.kinematics import Robot

__all__ = ["Angles", "Robot", "circle", "step", "waypoints"]
