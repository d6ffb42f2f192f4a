"""`smad status`: everything about the bench on one screen."""

import shutil
import sys
import time

import click

from smad.cli.options import Command, axis_option, flag, json_option
from smad.cli.output import client, print_json
from smad.view.terminal.status_lines import lines, other_benches, printed

_REFRESH_S = 0.5


@click.command(cls=Command)
def status(
    watch: bool = flag(
        "--watch", "Show a screen, drawn twice a second; space or Esc stops the bench."
    ),
    as_json: bool = json_option,
    bench: str = axis_option,
) -> None:
    """Show link, board, motion, readings, timing, run log."""
    with client(bench) as bench_client:
        if watch and not as_json:
            if not (sys.stdin.isatty() and sys.stdout.isatty()):
                raise click.UsageError("--watch needs a terminal; --watch --json prints lines.")
            from smad.view.terminal import watch as screen

            bench_client.timeout_s = screen.PATIENCE_S
            screen.run(bench_client)
            return
        while True:
            now = bench_client.status()
            if as_json:
                print_json(now, indent=-1)
            else:
                width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
                for line in (*lines(now), *other_benches(now.bench)):
                    click.echo(printed(line, width))
            if not watch:
                return
            time.sleep(_REFRESH_S)
