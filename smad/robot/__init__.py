"""A robot on a bench of several axes: joint angles of its segments, in place of millimetres."""

from smad.robot.angles import Angles, circle, sine, step, waypoints
from smad.robot.kinematics import Robot, Segment

__all__ = ["Angles", "Robot", "Segment", "circle", "sine", "step", "waypoints"]
