"""`smad robot` and `smad run six-axes`: joint angles on a bench of several axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.options import (
    NEGATIVE,
    OUTPUT,
    PATH,
    Command,
    Group,
    argument,
    bench_option,
    flag,
    option,
    wait_option,
)
from smad.cli.output import carry_out, client
from smad.cli.quantity import Quantity, Whole
from smad.view.terminal.progress import progress
from smad.view.terminal.tables import print_table

if TYPE_CHECKING:
    from smad.client import Client
    from smad.robot import Angles

TITLE = "circles of the segments of a robot, in turn and together"
"""What `smad run six-axes` does."""
_period = option("--period", "Seconds for one circle.", Quantity("s", 0.5, 3600.0), default=20.0)


@click.group(cls=Group)
def robot() -> None:
    """Move the segments of a robot by the angles of their joints."""


@robot.command()
def angles(bench: str = bench_option) -> None:
    """Show pitch and yaw of each segment."""
    from smad.robot.moving import robot_of, standing_deg

    with client(bench) as connected:
        for name, (pitch, yaw) in standing_deg(connected, robot_of(connected)).items():
            click.echo(f"{name}: pitch {pitch:+.2f}°, yaw {yaw:+.2f}°")


@robot.command(context_settings=NEGATIVE)
def step(
    *,
    segment: str = argument(),
    pitch_deg: float = argument(Quantity("deg")),
    yaw_deg: float = argument(Quantity("deg")),
    duration_s: float = option(
        "--for", "Seconds to stay there.", Quantity("s", 0.1, 3600.0), default=10.0
    ),
    wait: bool = wait_option,
    bench: str = bench_option,
) -> None:
    """Turn SEGMENT to PITCH_DEG and YAW_DEG."""
    from smad.robot import step as course_of_step
    from smad.robot.moving import robot_of, standing_deg

    with client(bench) as connected:
        now = standing_deg(connected, robot_of(connected)).get(segment, (0.0, 0.0))
        course = course_of_step((pitch_deg, yaw_deg), duration_s=duration_s, from_deg=now)
        _move(connected, segment, course, wait=wait)


@robot.command(context_settings=NEGATIVE)
def circle(
    *,
    segment: str = argument(),
    radius_deg: float = argument(Quantity("deg", 0.0, 180.0)),
    period_s: float = _period,
    cycles: int = option("--cycles", "Number of circles.", Whole(1, 1000), default=1),
    wait: bool = wait_option,
    bench: str = bench_option,
) -> None:
    """Draw a circle with the tip of SEGMENT, from straight and back."""
    from smad.robot import circle as course

    with client(bench) as connected:
        _move(connected, segment, course(radius_deg, period_s=period_s, cycles=cycles), wait=wait)


@robot.command()
def follow(
    segment: str = argument(),
    path: Path = argument(PATH),
    wait: bool = wait_option,
    bench: str = bench_option,
) -> None:
    """Follow the points of a CSV file.

    Its columns are t_s, pitch_deg and yaw_deg.
    """
    from smad.robot import waypoints

    with client(bench) as connected:
        _move(connected, segment, waypoints(path), wait=wait)


@click.command("six-axes", cls=Command)
def six_axes(
    *,
    sim: bool = flag("--sim", "On a simulated bench of six axes."),
    radius_deg: float = option("--radius", "Degrees.", Quantity("deg", 0.1, 180.0), default=15.0),
    period_s: float = _period,
    report: Path | None = option("--report", "Page; by default beside the log.", OUTPUT),
    bench: str = bench_option,
) -> None:
    """Let the segments draw circles, in turn and together.

    It arms the running bench, or with --sim its own. At the end it disarms, and writes a table and
    a page.
    """
    from smad.experiments.circles import draw, page_of, skew_in_words, table, trackings
    from smad.processes.simulated import simulated_axes
    from smad.report.page import write_page
    from smad.robot.moving import robot_of
    from smad.runlog.reader import read_axes

    with simulated_axes(6) if sim else client(bench) as connected, progress() as line:
        robot_used = robot_of(connected)
        log, skew = draw(connected, robot_used, radius_deg, period_s, line.say)
    written = write_page(page_of(log, robot_used, skew), report or log.with_suffix(".html"))
    print_table(table(list(trackings(read_axes(log), robot_used))))
    click.echo(skew_in_words(skew))
    click.echo(written)


def _move(connected: Client, segment: str, course: Angles, *, wait: bool) -> None:
    from smad.robot.moving import move_segment

    carry_out(connected, move_segment, connected, segment, course, wait=wait, what=segment)
