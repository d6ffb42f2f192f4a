"""`smad robot`: joint angles of the segments on a bench of several axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import (
    NEGATIVE,
    PATH,
    bench_option,
    client,
    wait_for_motion,
    wait_option,
)
from smad.cli.quantity import Quantity, Whole

if TYPE_CHECKING:
    from smad.client import Client
    from smad.robot import Angles

_segment = click.argument("segment")
circle_period_option = click.option(
    "--period",
    "period_s",
    type=Quantity("s", 0.5, 3600.0),
    default=20.0,
    help="Seconds for one circle.",
)


@click.group()
def robot() -> None:
    """Move the segments of a robot by the angles of their joints."""


@robot.command()
@bench_option
def angles(bench: str) -> None:
    """Show pitch and yaw of each segment."""
    from smad.robot.moving import robot_of, standing_deg

    with client(bench) as connected:
        for name, (pitch, yaw) in standing_deg(connected, robot_of(connected)).items():
            click.echo(f"{name}: pitch {pitch:+.2f}°, yaw {yaw:+.2f}°")


@robot.command(context_settings=NEGATIVE)
@_segment
@click.argument("pitch_deg", type=Quantity("deg"))
@click.argument("yaw_deg", type=Quantity("deg"))
@click.option(
    "--for",
    "duration_s",
    type=Quantity("s", 0.1, 3600.0),
    default=10.0,
    help="Seconds to stay there.",
)
@wait_option
@bench_option
def step(
    *, segment: str, pitch_deg: float, yaw_deg: float, duration_s: float, wait: bool, bench: str
) -> None:
    """Turn SEGMENT to PITCH_DEG and YAW_DEG."""
    from smad.robot import step as made
    from smad.robot.moving import robot_of, standing_deg

    with client(bench) as connected:
        now = standing_deg(connected, robot_of(connected)).get(segment, (0.0, 0.0))
        wanted = made((pitch_deg, yaw_deg), duration_s=duration_s, from_deg=now)
        _move(connected, segment, wanted, wait=wait)


@robot.command(context_settings=NEGATIVE)
@_segment
@click.argument("radius_deg", type=Quantity("deg", 0.0, 180.0))
@circle_period_option
@click.option("--cycles", type=Whole(1, 1000), default=1, help="Number of circles.")
@wait_option
@bench_option
def circle(
    *, segment: str, radius_deg: float, period_s: float, cycles: int, wait: bool, bench: str
) -> None:
    """Draw a circle with the tip of SEGMENT, from straight and back."""
    from smad.robot import circle as made

    with client(bench) as connected:
        _move(connected, segment, made(radius_deg, period_s=period_s, cycles=cycles), wait=wait)


@robot.command()
@_segment
@click.argument("path", type=PATH)
@wait_option
@bench_option
def follow(segment: str, path: Path, wait: bool, bench: str) -> None:
    """Follow the points of a CSV file.

    Its columns are t_s, pitch_deg and yaw_deg.
    """
    from smad.robot import waypoints

    with client(bench) as connected:
        _move(connected, segment, waypoints(path), wait=wait)


def _move(connected: Client, segment: str, wanted: Angles, *, wait: bool) -> None:
    from smad.robot.moving import move_segment

    move_segment(connected, segment, wanted)
    wait_for_motion(connected, wait=wait, what=segment)
