"""Segments of the robot on a running bench, by way of a client."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from smad.config import parse_config
from smad.robot.angles import Angles
from smad.robot.kinematics import Robot

if TYPE_CHECKING:
    from smad.client import Client


def robot_of(client: Client) -> Robot:
    """Return the robot that the bench is configured as."""
    return Robot.of(parse_config(client.config()))


def standing_deg(client: Client, robot: Robot) -> dict[str, tuple[float, float]]:
    """Return pitch and yaw of each segment as they stand now."""
    axes = client.motion().axes or {}
    mm = {a: np.array([axes[a].displacement_mm or 0.0]) for a in robot.axes}
    return {name: (float(p[0]), float(y[0])) for name, (p, y) in robot.angles_deg(mm).items()}


def move_segment(client: Client, segment: str, angles: Angles) -> None:
    """Let a segment follow angles; the other joints keep theirs. Raises CommandError."""
    robot = robot_of(client)
    standing = {}
    for name, (pitch, yaw) in standing_deg(client, robot).items():
        standing[robot.segments[name].pitch], standing[robot.segments[name].yaw] = pitch, yaw
    client.move(robot.moves({segment: angles}, standing_deg=standing))
