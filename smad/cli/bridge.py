"""`smad bridge`: the live bench in other viewers."""

import asyncio
import contextlib

import click

from smad.cli.options import Group, bench_option, port_option
from smad.view.terminal.progress import note


@click.group(cls=Group)
def bridge() -> None:
    """Show the live bench in another viewer, read-only."""


@bridge.command()
def foxglove(port: int = port_option(8765), bench: str = bench_option) -> None:
    """Serve Foxglove and Lichtblick on this machine, until ctrl-C.

    Viewers see samples, link counters, events and parameters. They command nothing.
    """
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(bench, port))


async def _serve(bench: str, port: int) -> None:
    from smad.bridge.server import serving

    async with serving(bench, port, note) as served:
        click.echo(f"connect to {served.address} (Foxglove WebSocket)")
        click.echo("Anyone on this machine can watch. Ctrl-C ends the bridge, not the bench.")
        await asyncio.Event().wait()
