"""What commands share: a client, progress on standard error, colours on terminals only."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click

from smad.cli.options import AXIS

if TYPE_CHECKING:
    from smad.client import Client
    from smad.experiments.leased import LeasedDriver
    from smad.progress import Say

FIRST_PROGRESS_S = 2.0
_LINE_EVERY_S = 5.0


def client(bench: str, *, lasting: bool = False) -> Client:
    """Return a client of the running daemon, for the axis that `--axis` names. Raises NoDaemon.

    With `lasting` the bench stays armed after the command that arms it: no lease is taken.
    """
    from smad.client import Client

    context = click.get_current_context(silent=True)
    axis = "" if context is None else context.meta.get(AXIS, "")
    made = Client(bench, axis=axis, lease_s=None) if lasting else Client(bench, axis=axis)
    made_clients.append(made)
    return made


@contextlib.contextmanager
def ready_client(bench: str, *, extra: str = "") -> Iterator[Client]:
    """A client of a program that arms: signals end it, and a stop before it arms is known.

    Raises what `require_ready` does where something is missing that is needed afterwards.
    """
    from smad.client.signals import ended_by_signals
    from smad.experiments.ready import require_ready

    with ended_by_signals(), client(bench) as connected:
        connected.as_of(connected.motion().generation)
        require_ready(connected, extra=extra)
        yield connected


def leased_driver(
    connected: Client, who: str, lease_s: float, say: Say, **mounted: Any
) -> LeasedDriver:
    """What carries plans out on the bench of a client, armed for each under a lease of `who`.

    `mounted`: fixture and cooling, as `LiveDriver` takes them.
    """
    from smad.experiments.leased import LeasedDriver
    from smad.experiments.live import LiveDriver

    live = LiveDriver(connected, progress=say, **mounted)
    return LeasedDriver(connected, live, lease_s=lease_s, progress=say, who=who)


made_clients: list[Client] = []
"""Clients of this command: who ran it asks them which stops they know of."""


def note(text: str, *, nl: bool = True) -> None:
    """Print a line on standard error, whether or not anybody reads it any more.

    A reader that has gone (`2>&1 | head`) or a full disk ends nothing that is being done.
    """
    try:
        click.echo(text, nl=nl, err=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


class Progress:
    """One line that says what is going on, from two seconds on.

    On a terminal it is overwritten in place; elsewhere a new line comes every five seconds, if it
    says something new.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._began_s = clock_s()
        self._last_s = self._began_s
        self._last = ""
        self._terminal = sys.stderr.isatty()
        self._shown = False

    def say(self, text: str) -> None:
        """Show what is going on now."""
        now_s = self._clock_s()
        if now_s - self._began_s < FIRST_PROGRESS_S:
            return
        if self._terminal:
            note(f"\r\x1b[K{text}", nl=False)
            self._shown = True
        elif text != self._last and (not self._last or now_s - self._last_s >= _LINE_EVERY_S):
            note(text)
            self._last = text
            self._last_s = now_s

    def note(self, text: str) -> None:
        """Print a line that stays."""
        self.done()
        note(text)

    def done(self) -> None:
        """Take the line away."""
        if self._terminal and self._shown:
            note("\r\x1b[K", nl=False)


@contextlib.contextmanager
def progress() -> Iterator[Progress]:
    """A progress line for as long as the block lasts."""
    line = Progress()
    try:
        yield line
    finally:
        line.done()


def wait_for_motion(bench_client: Client, *, wait: bool, what: str) -> None:
    """Wait for a motion with a progress line; ctrl-C ends the motion, not only the waiting.

    So does a terminal that is closed, and SIGTERM.
    """
    from smad.client.signals import ended_by_signals
    from smad.view.terminal.status_lines import motion_words

    if not wait:
        click.echo(f"{what}: begun")
        return
    with ended_by_signals():
        try:
            with progress() as line:
                motion = bench_client.wait_until_done(
                    lambda now: line.say(f"{what}: {motion_words(now)}")
                )
        except (KeyboardInterrupt, SystemExit):
            bench_client.idle()
            click.echo(f"{what}: interrupted; the bench is idle now and still armed", err=True)
            raise
    click.echo(f"{what}: done; {motion_words(motion)}")


def print_json(value: object, *, indent: int = 2) -> None:
    """Print a value as JSON; with an indent of -1 on one line."""
    import msgspec

    text = msgspec.json.encode(value, enc_hook=str)
    click.echo(msgspec.json.format(text, indent=indent))
