"""What commands share: a client, progress on standard error, colours on terminals only."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from smad.cli.quantity import Quantity, Whole
from smad.files import require_writable

if TYPE_CHECKING:
    from msgspec import Struct

    from smad.api import Motion
    from smad.client import Client
    from smad.experiments.leased import LeasedDriver
    from smad.progress import Say

FIRST_PROGRESS_S = 2.0
_LINE_EVERY_S = 5.0

F = TypeVar("F", bound=Callable[..., Any])


class _Output(click.Path):
    """A file to write. It never replaces a recording."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path. Fails as a usage error where a recording would be lost."""
        if (path := Path(value)).is_file():
            from smad.records.tables import is_table
            from smad.runlog.paths import SUFFIX

            if path.name.lower().endswith(SUFFIX) or is_table(path):
                self.fail(
                    f"{value!r} is a recording, and would be lost. Name another file.", param, ctx
                )
        return super().convert(value, param, ctx)


PATH = click.Path(path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
EXISTING = click.Path(exists=True, dir_okay=False, path_type=Path)
OUTPUT = _Output(dir_okay=False, path_type=Path)
"""Types of options and arguments: anything, no folder, no file, a file that is there, a file to
write that is no recording."""


def require_outputs() -> None:
    """Raise unless each file that this command is to write can be, and is no other file of it.

    Raises a usage error for a file that the command reads, or writes a second time.
    """
    context = click.get_current_context()
    files = [
        (parameter, path)
        for parameter in context.command.params
        for path in _files(context.params.get(parameter.name or ""))
    ]
    for parameter, path in files:
        if not isinstance(parameter.type, _Output):
            continue
        require_writable(path)
        for other, named in files:
            if other is not parameter and named.resolve() == path.resolve():
                raise click.BadParameter(
                    f"{str(path)!r} is the file of {other.get_error_hint(context)}, too, and would "
                    "be replaced. Name another file.",
                    context,
                    parameter,
                )


def _files(value: object) -> list[Path]:
    """The paths among the values of a parameter; a text may name a file (`--params`)."""
    if isinstance(value, tuple):
        return [path for part in value for path in _files(part)]
    if isinstance(value, str) and Path(value).is_file():
        return [Path(value)]
    return [value] if isinstance(value, Path) else []


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
wait_option = click.option(
    "--wait/--no-wait", default=True, help="Wait until it is done, or return at once."
)

NEGATIVE = {"ignore_unknown_options": True}
"""Context of a command with numbers: without it, a -5 would be taken for an option."""


class Checked(click.Command):
    """A command whose options are checked together, by `require`, as soon as they are parsed.

    The queue parses a command when it is added, and begins it when nobody is there.
    """

    def __init__(self, *args: Any, require: Callable[[Mapping[str, Any]], None], **kw: Any) -> None:
        super().__init__(*args, **kw)
        self._require = require

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, and raise the usage error of options that do not belong together."""
        left = super().parse_args(ctx, args)
        if not ctx.resilient_parsing:
            self._require(ctx.params)
        return left


C = TypeVar("C", bound="Struct")


def checked(command: C, typed: Mapping[str, str]) -> C:
    """Return the command if its values are allowed; `typed`: how each field was given.

    Raises a usage error that names what was typed. The daemon checks it again.
    """
    import msgspec

    from smad.config.bounds import field_and_words
    from smad.units import in_words, unit_of

    values = msgspec.to_builtins(command)
    for name, value in values.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise click.BadParameter(
                f"{value:g} is not a finite number", param_hint=repr(typed.get(name, name))
            )
    try:
        msgspec.convert(values, type(command))
    except msgspec.ValidationError as error:
        name, bound = field_and_words(str(error))
        unit, value = f" {in_words(unit_of(name))}".rstrip(), values.get(name)
        shown = f"{value:g}" if isinstance(value, int | float) else repr(value)
        raise click.BadParameter(
            f"{shown}{unit}: {bound}{unit}", param_hint=repr(typed.get(name, name))
        ) from None
    return command


config_option = click.option(
    "--config",
    "path",
    type=PATH,
    envvar="SMAD_CONFIG",
    help="Configuration file (smad config show).",
)


def tcp_port_option(usual: int) -> Callable[[F], F]:
    """Return the option of a server's port."""
    return click.option(
        "--port",
        type=Whole(0, 65535),
        default=usual,
        help="TCP port on this machine; 0 takes any.",
    )


bench_option = click.option(
    "--bench",
    default="bench",
    envvar="SMAD_BENCH",
    help="Name of the bench, if there are several.",
)


def _remember(context: click.Context, parameter: click.Parameter, axis: str) -> None:
    context.meta[_AXIS] = axis


_AXIS = "smad.axis"
_axis_option = click.option(
    "--axis",
    default="",
    show_default=False,
    envvar="SMAD_AXIS",
    expose_value=False,
    callback=_remember,
    help="The axis, if the bench has several.",
)


def axis_option(command: F) -> F:
    """Add `--bench` and `--axis`: what the command asks its client is for that axis."""
    return bench_option(_axis_option(command))


lease_option = click.option(
    "--lease",
    type=Quantity("s", 0.5, 3600.0),
    default=2.0,
    metavar="S",
    help="On a real bench: the daemon disarms after this time without a message from this program.",
)


def client(bench: str, *, lasting: bool = False) -> Client:
    """Return a client of the running daemon, for the axis that `--axis` names. Raises NoDaemon.

    With `lasting` the bench stays armed after the command that arms it: no lease is taken.
    """
    from smad.client import Client

    context = click.get_current_context(silent=True)
    axis = "" if context is None else context.meta.get(_AXIS, "")
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

    if not wait:
        click.echo(f"{what}: begun")
        return
    with ended_by_signals():
        try:
            with progress() as line:
                motion = bench_client.wait_until_done(
                    lambda now: line.say(f"{what}: {described(now)}")
                )
        except (KeyboardInterrupt, SystemExit):
            bench_client.idle()
            click.echo(f"{what}: interrupted; the bench is idle now and still armed", err=True)
            raise
    click.echo(f"{what}: done; {described(motion)}")


def described(motion: Motion) -> str:
    """Return a motion in a few words."""
    from smad.view.terminal.axis_lines import aged

    parts = [f"{motion.running}, board {motion.mode}"]
    if motion.displacement_mm is not None:
        parts.append(f"at {motion.displacement_mm:.2f} mm{aged(motion)}")
    if motion.reference_mm is not None:
        parts.append(f"reference {motion.reference_mm:.2f} mm")
    if motion.fault is not None:
        parts.append(f"fault {motion.fault.name}")
    return ", ".join(parts)


def print_json(value: object, *, indent: int = 2) -> None:
    """Print a value as JSON; with an indent of -1 on one line."""
    import msgspec

    text = msgspec.json.encode(value, enc_hook=str)
    click.echo(msgspec.json.format(text, indent=indent))
