"""What commands share: a client, waiting for a motion, JSON."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click

from smad.cli.options import AXIS
from smad.processes.stops import KnownStops
from smad.view.terminal.progress import progress

if TYPE_CHECKING:
    from smad.client import Client


def client(bench: str, *, lasting: bool = False) -> Client:
    """Return a client of the running daemon, for the axis that `--axis` names. Raises NoDaemon.

    With `lasting` the bench stays armed after the command that arms it: no lease is taken.
    """
    from smad.client import Client

    context = click.get_current_context(silent=True)
    axis = "" if context is None else context.meta.get(AXIS, "")
    opened = Client(bench, axis=axis, lease_s=None) if lasting else Client(bench, axis=axis)
    if (known_stops := _known_stops()) is not None:
        known_stops.clients.append(opened)
    return opened


def _known_stops() -> KnownStops | None:
    """What this command knows of stops; None outside one."""
    context = click.get_current_context(silent=True)
    known_stops = None if context is None else context.find_root().obj
    return known_stops if isinstance(known_stops, KnownStops) else None


@contextlib.contextmanager
def ready_client(bench: str, *, extra: str = "") -> Iterator[Client]:
    """A client of a program that arms: signals end it, and a stop before it arms is known.

    Raises what `require_ready` does where something is missing that is needed afterwards.
    """
    from smad.client.signals import ended_by_signals
    from smad.experiments.ready import require_ready

    with ended_by_signals(), client(bench) as connected:
        known_stops = _known_stops()
        known = None if known_stops is None else known_stops.latest
        connected.as_of(connected.motion().generation if known is None else known)
        require_ready(connected, extra=extra)
        yield connected


def carry_out(
    client: Client, begin: Callable[..., Any], *given: Any, wait: bool, what: str, **named: Any
) -> None:
    """Begin a motion, and wait for its end with a progress line.

    Ctrl-C, a closed terminal and SIGTERM end the motion, also while it is being sent.
    """
    from smad.client.signals import ended_by_signals
    from smad.view.terminal.status_lines import motion_words

    with ended_by_signals():
        try:
            begin(*given, **named)
            if not wait:
                click.echo(f"{what}: begun")
                return
            with progress() as line:
                motion = client.wait_until_done(lambda m: line.say(f"{what}: {motion_words(m)}"))
        except (KeyboardInterrupt, SystemExit):
            client.idle()
            click.echo(f"{what}: interrupted; the bench is idle now and still armed", err=True)
            raise
    click.echo(f"{what}: done; {motion_words(motion)}")


def print_json(value: object, *, indent: int = 2) -> None:
    """Print a value as JSON; with an indent of -1 on one line."""
    click.echo(json_text(value, indent))


def json_text(value: object, indent: int) -> bytes:
    r"""Return a value as JSON; with an indent of -1 on one line.

    A byte of a file name that is no UTF-8 is written as `\xff`: JSON has no letter for it.
    """
    import json
    import re

    import msgspec

    try:
        text = msgspec.json.encode(value, enc_hook=str)
    except UnicodeEncodeError:
        plain = json.dumps(msgspec.to_builtins(value, enc_hook=str), ensure_ascii=False)
        escaped = re.sub("[\udc80-\udcff]", lambda byte: rf"\\x{ord(byte[0]) & 0xFF:02x}", plain)
        # What is no number is null, as above.
        text = msgspec.json.encode(json.loads(escaped, parse_constant=lambda _: None))
    return msgspec.json.format(text, indent=indent)
