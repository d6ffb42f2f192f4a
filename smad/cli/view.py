"""`smad view`: the live page in a browser."""

import asyncio
import contextlib

import click

from smad.cli.options import Command, bench_option, flag, port_option


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
    import webbrowser

    from smad.view.server import serving

    async with serving(bench, port, watch_only=watch_only) as page:
        links = page.links
        if links.command:
            click.echo(f"command: {links.command}")
        click.echo(f"watch:   {links.watch}")
        click.echo("Anyone with a link can use it. Ctrl-C ends the page, not the bench.")
        if browser and not webbrowser.open(links.command or links.watch):
            click.echo("no browser was found here; open a link yourself", err=True)
        await asyncio.Event().wait()
