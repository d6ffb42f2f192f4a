"""`smad config`: show the configuration, and check a file."""

from pathlib import Path

import click

from smad.cli.options import PATH, Group, argument, axis_option, flag
from smad.cli.output import client


@click.group(cls=Group)
def config() -> None:
    """Print or check a configuration."""


@config.command()
def show(
    running: bool = flag("--running", "The one a running daemon uses."), bench: str = axis_option
) -> None:
    """Print the default configuration, or the one in use."""
    if running:
        with client(bench) as bench_client:
            click.echo(bench_client.config(), nl=False)
        return
    from smad.config import default_toml

    click.echo(default_toml(), nl=False)


@config.command()
def check(path: Path = argument(PATH)) -> None:
    """Check the keys, ranges, axes and data rate of a file."""
    from smad.config import load_config
    from smad.daemon.link.wirerate import check_rate

    loaded = load_config(path)
    loaded.turns()
    share = check_rate(loaded.link.rate_hz, loaded.link.baud)
    click.echo(
        f"{path}: good; {loaded.link.rate_hz} Hz fill {share:.0%} of {loaded.link.baud} baud"
    )
