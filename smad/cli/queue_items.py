"""What may be queued: kinds of items, the command line of each, and what is checked before it runs.

The words are parsed by the very command that will run, so its arguments, ranges and names hold.
"""

from __future__ import annotations

import importlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from firmware_protocol.nearest import instead
from smad.cli.options import require_outputs
from smad.errors import ComputerError, SmadError
from smad.queue.admission import require_startable
from smad.queue.errors import QueueError
from smad.queue.machine import Obstacle

if TYPE_CHECKING:
    from smad.queue.states import Item

KINDS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "run": (("run",), "smad.cli.run:run"),
    "tune": (("tune", "--yes"), "smad.cli.tune:tune"),
    "checkup": (("gap", "checkup"), "smad.cli.gap_checkup:checkup"),
    "move": (("run", "moves"), "smad.cli.repeat:moves"),
}
"""Kind -> the words after `smad` that it begins with, and where the command is.

Whoever arms a queue has agreed to what is in it, so `smad tune` does not ask.
"""


def items_of(kind: str, arguments: Sequence[str], folder: Path, repeat: int) -> list[Item]:
    """Return `repeat` items of a kind, checked. Raises QueueError, or what the command raises."""
    from smad.experiments.registry import whole_names
    from smad.queue.states import Item

    if kind not in KINDS:
        raise QueueError(
            "there is no such kind of item",
            value=kind,
            action=instead(kind, KINDS, ", ".join(KINDS)),
        )
    lead, _ = KINDS[kind]
    words = [*lead, *(whole_names(arguments) if kind == "run" else arguments)]
    title = shlex.join([kind, *words[len(lead) :]])
    bench = not _checked(kind, words, folder)
    titles = (
        [title] if repeat == 1 else [f"{title} ({n} of {repeat})" for n in range(1, repeat + 1)]
    )
    return [
        Item(kind=kind, title=text, words=tuple(words), folder=str(folder), on_bench=bench)
        for text in titles
    ]


def without_repeat(words: tuple[str, ...], repeat: int) -> tuple[tuple[str, ...], int]:
    """Take `--repeat N` out of the words; `smad run` has no such option."""
    rest = list(words)
    for place, word in enumerate(rest):
        name, equals, value = word.partition("=")
        if name == "--repeat":
            value = value if equals else (rest[place + 1] if place + 1 < len(rest) else "")
            try:
                repeat = int(value)
            except ValueError:
                repeat = 0
            if not 1 <= repeat <= 1000:
                raise click.UsageError(f"--repeat {value}: give a number from 1 to 1000")
            return tuple(rest[:place] + rest[place + (1 if equals else 2) :]), repeat
    return words, repeat


def obstacle_of(item: Item) -> Obstacle | None:
    """Return why an item cannot begin now; None when nothing speaks against it."""
    try:
        _checked(item.kind, item.words, Path(item.folder))
    except SmadError as error:
        return Obstacle(str(error), of_computer=isinstance(error, ComputerError))
    except click.ClickException as error:
        return Obstacle(error.format_message())
    return None


def _checked(kind: str, words: Sequence[str], folder: Path) -> bool:
    """Raise unless the command can begin in `folder`; return whether it is simulated."""
    lead, place = KINDS[kind]
    module, _, attribute = place.partition(":")
    command: click.Command = getattr(importlib.import_module(module), attribute)
    if not folder.is_dir():
        raise QueueError(f"the folder {folder} is gone", action="make it again, or remove the item")
    if {"--help", "-h"} & set(words):
        raise QueueError(
            "a command with --help does nothing, so it is not queued",
            action=f"give smad {' '.join(lead)} --help itself",
        )
    context = command.make_context(" ".join(["smad", *lead]), list(words[len(lead) :]))
    require_outputs(context, folder)
    require_startable(kind, context.params, folder)
    return bool(context.params.get("sim"))
