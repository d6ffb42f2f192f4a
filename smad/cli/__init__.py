"""The command line: one file a group of commands, each imported only when it is used.

Whatever goes wrong ends in one line on standard error and a non-zero status, never a traceback.
"""

import errno
import importlib
import os
import re
import sys
from collections.abc import Mapping, Sequence

import click

from firmware_protocol.nearest import instead
from smad.errors import SmadError, reported, unusable_path
from smad.extras import missing
from smad.processes.oom import prefer_as_oom_victim
from smad.processes.stops import KnownStops, taken_over
from smad.processes.streams import prepare_streams
from smad.units import is_unit
from smad.version import VERSION

_OF_DRIVE = ("arm", "disarm", "estop", "clear", "heat", "current", "pump", "idle")
_NAMES = (
    "demo", "design", "start", "sim", "status", "view", "bridge", "arm", "disarm", "estop", "clear",
    "move", "heat", "current", "pump", "idle", "robot", "params", "record", "link", "config",
    "faults", "keys", "service", "log", "run", "tune", "queue", "hooks", "health", "gap", "model",
    "docs",
)  # fmt: skip
COMMANDS: dict[str, str] = {
    name: f"smad.cli.{'drive' if name in _OF_DRIVE else name}:{name}" for name in _NAMES
}
"""Every command and where it lives; `smad status` would feel the import of numpy or matplotlib."""

READS_FILES = frozenset(("log", "gap", "run", "view", "health"))
"""Commands that are ended first when memory runs out: before the daemon, which has the bench."""

SYNONYMS: Mapping[str, str] = {"mark": "note", "check-up": "checkup", "ls": "list"}
"""Words of the live page and of habit, and the command that does it."""
_STOPS = ("stop", "halt", "off", "abort")
"""What somebody in a hurry types to switch off; `smad record stop` only ends a recording."""

_NO_COMMAND = re.compile(r"No such command '([^']+)'")
_EXTRA = re.compile(r"Got unexpected extra argument \((\S+)\)")
_NO_NUMBER = re.compile(r"is not a valid (float|integer)")
_NUMBERS = {"float": "number", "integer": "whole number"}
INTERRUPTED = 130
INTERNAL = 70
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called, or listed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command; None when there is none of that name."""
        place = COMMANDS.get(cmd_name)
        if place is None:
            return None
        module, _, attribute = place.partition(":")
        try:
            command = getattr(importlib.import_module(module), attribute)
        except Exception as error:
            # One damaged part must not take the help, or the way to stop the bench, with it.
            return _Broken(cmd_name, error)
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is called; one misspelt is answered with the nearest."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            deeper = self._meant(ctx, args[0])
            suggestion = (
                f"did you mean {' or '.join(deeper)}?"
                if deeper
                else instead(args[0], COMMANDS, "smad --help lists them")
            )
            ctx.fail(f"There is no command {args[0]!r}; {suggestion}")
        return super().resolve_command(ctx, args)

    def _meant(self, ctx: click.Context, word: str) -> list[str]:
        """What a word means: `smad mark` is `smad record note`, `smad stop` `smad disarm`."""
        if word in _STOPS:
            return ["smad disarm", "smad estop"]
        command = SYNONYMS.get(word, word)
        groups = ((name, self.get_command(ctx, name)) for name in COMMANDS)
        return [
            f"smad {name} {command}"
            for name, group in groups
            if isinstance(group, click.Group) and command in group.list_commands(ctx)
        ]


class _Broken(click.Command):
    """Stands for a command that cannot be imported: listed as such, and says why when called."""

    def __init__(self, name: str, error: Exception) -> None:
        super().__init__(name, help="Not available here; run it to see why.")
        self._error = error

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Raise what the import raised: no argument would help."""
        raise self._error


@click.group(
    cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.version_option(VERSION, prog_name="smad")
def root() -> None:
    """Run a bench of two antagonistic shape-memory-alloy springs.

    `smad start --sim` starts a simulated bench; `smad demo` shows it at work.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    prepare_streams()
    status = execute(sys.argv[1:] if arguments is None else arguments)
    sys.exit(status)


def execute(arguments: Sequence[str]) -> int:
    """Run one command and return its exit status. An error becomes one line on standard error."""
    if arguments and arguments[0] in READS_FILES:
        prefer_as_oom_victim()
    inherited, _ = taken_over(os.environ)
    return run_group(root, arguments, "smad", KnownStops(inherited))


def run_group(
    group: click.Group,
    arguments: Sequence[str],
    program: str,
    known_stops: KnownStops | None = None,
) -> int:
    """Run one command of a group; return its exit status. Errors become one line."""
    try:
        result = group.main(
            args=list(arguments),
            prog_name=program,
            standalone_mode=False,
            obj=known_stops,
            color=False if os.environ.get("NO_COLOR") else None,
        )
        if sys.stdout is not None:
            sys.stdout.flush()
    except SmadError as error:
        return _complain(str(error), error.exit_status)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return error.exit_code
    except click.UsageError as error:
        path = error.ctx.command_path if error.ctx is not None else program
        complaint = (_hint(error) or error.format_message()).rstrip(".").replace("?.", "?")
        complaint = _NO_NUMBER.sub(lambda match: f"is not a {_NUMBERS[match[1]]}", complaint)
        end = "" if complaint.endswith("?") else "."
        return _complain(f"{complaint}{end} See {path} --help.", error.exit_code)
    except click.ClickException as error:
        return _complain(error.format_message(), error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        return _complain("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # Whoever read our output has gone; a second complaint at exit would help nobody.
        _discard_output()
        return 1
    except ModuleNotFoundError as error:
        extra = missing(error, arguments)
        return _complain(str(extra), 1) if extra else _complain(reported(error), INTERNAL)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            _discard_output()
            return _complain(f"the answer cannot be printed: {error.strerror}; make room", 1)
        reason = unusable_path(error)
        return _complain(reason, 1) if reason else _complain(reported(error), INTERNAL)
    return result if isinstance(result, int) else 0


def _hint(error: click.UsageError) -> str:
    """Say what was meant: a command by its other name, or a unit behind a space; or nothing."""
    context, message = error.ctx, error.format_message()
    if context is None:
        return ""
    if (match := _NO_COMMAND.match(message)) and isinstance(context.command, click.Group):
        suggestion = SYNONYMS.get(match[1], "")
        if suggestion in context.command.list_commands(context):
            return f"{match[0]}. Did you mean {suggestion!r}?"
    if (match := _EXTRA.match(message)) and match[1][:1].isalpha() and is_unit(match[1]):
        return f"{message.rstrip('.')}: write a unit without a space, as in 5{match[1]}"
    return ""


def _discard_output() -> None:
    """Let what is still to be printed go nowhere, so that nothing complains of it at the exit."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(message: str, status: int) -> int:
    click.echo(f"smad: {' '.join(message.split())}", err=True)
    return status
