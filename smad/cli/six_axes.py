"""`smad run six-axes`: circles of the segments of a robot, in turn and together."""

from pathlib import Path

import click

from smad.cli.options import OUTPUT, Command, bench_option, flag, option
from smad.cli.output import client
from smad.cli.quantity import Quantity
from smad.cli.robot import circle_period_option
from smad.counted import counted
from smad.view.terminal.progress import progress

TITLE = "circles of the segments of a robot, in turn and together"


@click.command("six-axes", cls=Command)
def six_axes(
    *,
    sim: bool = flag("--sim", "On a simulated bench of six axes."),
    radius_deg: float = option("--radius", Quantity("deg", 0.1, 180.0), "Degrees.", default=15.0),
    period_s: float = circle_period_option,
    report: Path | None = option("--report", OUTPUT, "Page; by default beside the log."),
    bench: str = bench_option,
) -> None:
    """Let the segments draw circles, in turn and together.

    It arms the running bench, or with --sim its own. At the end it disarms, and writes a table and
    a page.
    """
    from smad.experiments.circles import Circles, draw, page_of, table, trackings
    from smad.processes.simulated import simulated_axes
    from smad.report.page import write_page
    from smad.robot.moving import robot_of
    from smad.runlog.reader import read_axes
    from smad.view.terminal.tables import print_table

    with simulated_axes(6) if sim else client(bench) as connected, progress() as line:
        made = robot_of(connected)
        log, skew = draw(connected, made, Circles(radius_deg, period_s), line.say)
    written = write_page(page_of(log, made, skew), report or log.with_suffix(".html"))
    print_table(table(list(trackings(read_axes(log), made))))
    click.echo(
        f"{counted(skew.count, 'simultaneous start')}: {skew.p50_us / 1000:.2f} ms apart (median), "
        f"at most {skew.max_us / 1000:.2f} ms"
    )
    click.echo(written)
