"""`smad view`: the live page in a browser."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING

import click

from smad.cli.options import Command, bench_option, flag, port_option

if TYPE_CHECKING:
    from smad.view.server import Links


@click.command(cls=Command)
def view(
    port: int = port_option(8787),
    no_browser: bool = flag("--no-browser", "Only print the links."),
    watch_only: bool = flag("--watch-only", "Print no link that can command the bench."),
    bench: str = bench_option,
) -> None:
    """Serve the live page of the bench, and open it in a browser.

    Only this machine can open it, by the link with its token.
    """
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(bench, port, watch_only=watch_only, browser=not no_browser))


async def _serve(bench: str, port: int, *, watch_only: bool, browser: bool) -> None:
    from smad.view.server import serving

    async with serving(bench, port, watch_only=watch_only) as page:
        _tell(page.links)
        if browser:
            _open(page.links)
        await asyncio.Event().wait()


def _tell(links: Links) -> None:
    if links.command:
        click.echo(f"command: {links.command}")
    click.echo(f"watch:   {links.watch}")
    click.echo("Anyone with a link can use it. Ctrl-C ends the page, not the bench.")


def _open(links: Links) -> None:
    import webbrowser

    if not webbrowser.open(links.command or links.watch):
        click.echo("no browser was found here; open a link yourself", err=True)
