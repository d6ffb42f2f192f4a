"""What the shell offers on the tab key, from the tables that the commands themselves use.

Each function has the signature that click wants, and offers nothing where its table cannot be read.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import click
from click.shell_completion import CompletionItem

Offer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
RUN_COMMANDS = {
    "repeat": "smad.cli.repeat",
    "six-axes": "smad.cli.robot",
    "moves": "smad.cli.repeat",
    "endurance": "smad.cli.run_endurance",
}
"""Commands under the name of `smad run`, and their modules."""


def _offer(names: Callable[[], Iterable[tuple[str, str]]]) -> Offer:
    def offered(
        context: click.Context, parameter: click.Parameter, typed: str
    ) -> list[CompletionItem]:
        # A part that is not installed has no names to offer, and the tab key no place for errors.
        with contextlib.suppress(ImportError, OSError):
            prefix = typed.lower()
            return [
                CompletionItem(name, help=about or None)
                for name, about in names()
                if name.lower().startswith(prefix)
            ]
        return []

    return offered


@_offer
def parameters() -> Iterator[tuple[str, str]]:
    from firmware_protocol.parameters import PARAMETERS

    return ((entry.name, entry.doc) for entry in PARAMETERS)


@_offer
def experiments() -> Iterator[tuple[str, str]]:
    from smad.experiments.registry import EXPERIMENTS

    return ((name, "") for name in (*EXPERIMENTS, "all", *RUN_COMMANDS))


@_offer
def effects() -> Iterator[tuple[str, str]]:
    from sim_device.plant.effects.registry import EFFECTS

    return ((effect.name, effect.title) for effect in EFFECTS)


@_offer
def faults() -> Iterator[tuple[str, str]]:
    from firmware_protocol.enums import Fault

    return ((fault.name, "") for fault in Fault if fault is not Fault.NONE)


def runs(context: click.Context, parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """Offer the run logs of the command's folder, newest first, and other files as usual."""
    folder = Path(str(context.params.get("folder") or "runs"))
    logs = sorted((str(path) for path in folder.glob("*.mcap")), reverse=True)
    offered = [CompletionItem(path) for path in logs if path.startswith(typed)]
    return offered or [CompletionItem(typed, type="file")]
