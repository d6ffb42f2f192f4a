"""`smad status`: everything about the bench on one screen."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import click

from smad.cli.options import Command, axis_option, flag, json_option
from smad.cli.output import client, print_json
from smad.view.terminal.status_lines import labelled, lines

if TYPE_CHECKING:
    from smad.client import Client

_REFRESH_S = 0.5


@click.command(cls=Command)
def status(
    watch: bool = flag("--watch", "A screen, drawn twice a second; the space bar stops the bench."),
    as_json: bool = json_option,
    bench: str = axis_option,
) -> None:
    """Show link, board, motion, readings, timing, run log."""
    with client(bench) as bench_client:
        if watch and not as_json:
            _watch(bench_client)
            return
        while True:
            now = bench_client.status()
            if as_json:
                print_json(now, indent=-1)
            else:
                _print((*lines(now), *_other_benches(now.bench)))
            if not watch:
                return
            time.sleep(_REFRESH_S)


def _print(facts: Iterable[str]) -> None:
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    for line in facts:
        click.echo(folded(line, width))


def folded(line: str, width: int) -> str:
    """Return a labelled line in lines of at most `width`: the text goes on below itself."""
    return click.wrap_text(line, width, subsequent_indent=labelled("", ""))


def _watch(bench_client: Client) -> None:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("--watch needs a terminal; --watch --json prints lines.")
    from smad.view.terminal import watch

    bench_client.timeout_s = watch.PATIENCE_S
    watch.run(bench_client)


def _other_benches(bench: str) -> Iterator[str]:
    """Name the other benches that run, if any."""
    from smad.client.endpoints import candidate_folders, running_benches

    others = [name for name in running_benches(candidate_folders()) if name != bench]
    if others:
        yield labelled("also", f"{', '.join(others)} (smad status --bench NAME)")
