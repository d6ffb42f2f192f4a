"""Runs on the command line of the diagnosis: files, patterns and folders, several to an option."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from smad.cli import complete
from smad.cli.options import Command, argument, option
from smad.runlog.paths import names_of
from smad.view.terminal.progress import note


class ManyRuns(Command):
    """A command with options of files (`_GREEDY`) that take all up to the next option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        return super().parse_args(ctx, _with_option_repeated(args))


_GREEDY = ("--hold-out", "--good", "--inputs")


def _with_option_repeated(args: Sequence[str]) -> list[str]:
    """The arguments with the name of a greedy option before each of its values."""
    out: list[str] = []
    option = ""
    for i, arg in enumerate(args):
        if arg == "--":
            return [*out, *args[i:]]
        if arg.startswith("-"):
            option = arg if arg in _GREEDY else ""
            following = args[i + 1] if i + 1 < len(args) else "--"
            if not option or following.startswith("-"):
                out.append(arg)
        else:
            out += [option, arg] if option else [arg]
    return out


def files(ctx: click.Context, param: click.Parameter, values: Sequence[str]) -> tuple[Path, ...]:
    """A callback: the run logs that files, patterns ('runs/*.mcap') and folders stand for."""
    return tuple(path for value in values for path in _files(value, ctx, param))


def files_option(name: str, about: str) -> Any:
    """Return an option that takes such files, and may be repeated."""
    return option(name, about, multiple=True, callback=files)


def _files(value: str, ctx: click.Context, param: click.Parameter) -> list[Path]:
    from smad.records.finding import runs_at

    paths, lacking = runs_at(value, note)
    if not paths:
        raise click.BadParameter(
            f"{lacking}. Give run logs, a folder of them or a quoted pattern", ctx, param
        )
    return paths


runs_argument = argument(
    nargs=-1, required=True, callback=files, metavar="RUN…", shell_complete=complete.runs
)
some_runs_argument = argument(
    nargs=-1, callback=files, metavar="[RUN…]", shell_complete=complete.runs
)
leave_out_option = option(
    "--leave-out RUN", "Leave out the run of this name, as the answer calls it.", multiple=True
)
trust_option = option(
    "--trust RUN", "Use this run although its channels contradict the nominal model.", multiple=True
)
hold_out_option = files_option(
    "--hold-out RUN…",
    "Runs for judging: files, patterns or folders. Fitted only if they repeat good runs.",
)
good_option = files_option(
    "--good RUN…", "Runs known to be good: files, patterns or folders, up to the next option."
)


def without_left_out(
    groups: Sequence[Sequence[Path]], left_out: Sequence[str]
) -> list[tuple[Path, ...]]:
    """The groups without runs of these names: of a file, with or without its suffix, or its path.

    Raises BadParameter where a name is of none of them.
    """
    require_among(left_out, groups, "--leave-out")
    return [tuple(p for p in group if not names_of(p) & set(left_out)) for group in groups]


def require_among(names: Sequence[str], groups: Sequence[Sequence[Path]], option: str) -> None:
    """Raises BadParameter where a name is of none of the runs given."""
    words = {word for group in groups for path in group for word in names_of(path)}
    for name in names:
        if name not in words:
            file_names = ", ".join(sorted({path.name for group in groups for path in group}))
            raise click.BadParameter(
                f"{name!r} is not among the runs given. They are: {file_names}", param_hint=option
            )


def without_cut_runs(good: Sequence[Path]) -> tuple[Path, ...]:
    """The good runs that no stop cut. Raises BadParameter when there were some and none is left."""
    from smad.checkup.files import whole_runs

    whole = whole_runs(good, note)
    if good and not whole:
        raise click.BadParameter(
            "every good run was cut short. Give complete runs", param_hint="--good"
        )
    return whole
