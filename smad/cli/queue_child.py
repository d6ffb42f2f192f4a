"""`python -m smad.cli.queue_child PARENT BENCH WORD…`: a command of smad as an item of the queue.

Its exit status says what ended it (`smad.queue.machine`): an error alone would not tell a stop,
which pauses the queue, from a refusal, which does not. It ends with its parent, the runner: asked
to by the kernel, and killed if it does not. It arms only if no stop came that its parent did not
know of, and tells it which ones it knows of in the end (`smad.processes.stops`).
"""

import os
import sys
import traceback
from collections.abc import Sequence

import click

from smad.cli import INTERNAL, INTERRUPTED, root
from smad.errors import SmadError
from smad.processes.parent import end_group_with
from smad.processes.stops import KnownStops, hand_back, taken_over
from smad.queue.ending import is_used_up, status_of, unseen_stop
from smad.queue.machine import SHORT, STOPPED


def main(arguments: Sequence[str]) -> int:
    """Run the command; return its exit status."""
    parent, bench, *words = arguments
    end_group_with(int(parent))
    inherited, report = taken_over(os.environ)
    known_stops = KnownStops(inherited)
    try:
        return _run(bench, words, known_stops)
    finally:
        hand_back(report, known_stops.latest)


def _run(bench: str, words: list[str], known_stops: KnownStops) -> int:
    try:
        root.main(args=words, prog_name="smad", standalone_mode=False, obj=known_stops)
    except SmadError as error:
        click.echo(f"smad: {error}", err=True)
        return status_of(error)
    except click.ClickException as error:
        click.echo(f"smad: {error.format_message()}", err=True)
        return error.exit_code
    except click.Abort:
        return INTERRUPTED
    except Exception as error:
        traceback.print_exc()
        return SHORT if is_used_up(error) else INTERNAL
    if stop := unseen_stop(known_stops.clients, bench):
        click.echo(f"smad: {stop}", err=True)
    return STOPPED if stop else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
