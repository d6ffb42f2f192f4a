"""`smad link`: how well the line to the board works."""

import click

from smad.cli.options import Group, axis_option, option
from smad.cli.output import client
from smad.cli.quantity import Quantity
from smad.view.terminal.progress import progress


@click.group(cls=Group)
def link() -> None:
    """Test the serial link."""


@link.command("test")
def count(
    duration_s: float = option(
        "--for", "Seconds to count.", Quantity("s", 0.01, 3600.0), default=5.0
    ),
    bench: str = axis_option,
) -> None:
    """Count samples, errors and delays for some seconds.

    The exit status is 1 if a sample was lost.
    """
    from smad.client.link_counts import count_link
    from smad.view.terminal.status_lines import count_lines

    with client(bench) as bench_client, progress() as line:
        counts = count_link(bench_client, duration_s, line.say)
    counts.require_samples()
    click.echo("\n".join(count_lines(counts)))
    counts.require_clean()
