"""Options and arguments of commands, each declared once: as the default of its parameter.

    @gap.command()
    def apply(
        *,
        verdict: Path = argument(EXISTING),
        first: int | None = option("--first", "Only this many causes.", Whole(0)),
    ) -> None:

Help that begins with `With --sim:` or `Without --figure:` is enforced where a command has these
options: what is given and would be ignored is a usage error.

Several that belong together are the fields of a dataclass, and `together(Simulator)` the default
of the parameter that takes it.
"""

import inspect
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import augment_usage_errors

from smad.cli.quantity import Quantity, Whole
from smad.errors import SmadError
from smad.files import require_writable

if TYPE_CHECKING:
    from msgspec import Struct


@dataclass(frozen=True)
class _Typed:
    """What is typed for a parameter, and what else is typed with it."""

    kind: type[click.Parameter]
    names: Sequence[str]
    settings: Mapping[str, Any]
    others: tuple[click.Parameter, ...] = ()

    def parameters(self, name: str) -> list[click.Parameter]:
        return [self.kind([*self.names, name], **self.settings), *self.others]


@dataclass(frozen=True)
class _Together:
    """A record whose fields are typed."""

    kind: type
    lead: str

    def parameters(self, name: str) -> list[click.Parameter]:
        parameters = list(_parameters_of(self.kind))
        for parameter in parameters:
            if self.lead and isinstance(parameter, click.Option) and parameter.help:
                parameter.help = self.lead + parameter.help[0].lower() + parameter.help[1:]
        return parameters


def option(names: str, help: str | None = None, type: Any = str, **settings: Any) -> Any:
    """Declare a parameter as an option of one value for each word behind its `names`.

    `"-o --output"` and `"--between LOW HIGH"` are examples; `settings` are those of `click.Option`.
    """
    words = names.split()
    flags, values = [w for w in words if w[0] == "-"], [w for w in words if w[0] != "-"]
    settings |= {"type": type, "help": help, "nargs": max(len(values), 1)}
    return _Typed(click.Option, flags, {"metavar": " ".join(values) or None, **settings})


def flag(names: str, help: str, **settings: Any) -> Any:
    """Declare a parameter as an option without a value."""
    return _Typed(click.Option, (names,), {"is_flag": True, "help": help, **settings})


def argument(type: Any = str, **settings: Any) -> Any:
    """Declare a parameter as an argument; `settings` are those of `click.Argument`."""
    return _Typed(click.Argument, (), {"type": type, **settings})


def together(kind: type, lead: str = "") -> Any:
    """Declare a parameter as a record, whose fields are declared as parameters are.

    `lead` begins the help of each. A record that opens something, by its method `open`, is opened
    for the command, whose function takes what that returns.
    """
    return _Together(kind, lead)


def _declared(function: Callable[..., Any]) -> Iterator[tuple[str, _Typed | _Together]]:
    for name, parameter in inspect.signature(function).parameters.items():
        if isinstance(parameter.default, _Typed | _Together):
            yield name, parameter.default


def _parameters_of(function: Callable[..., Any]) -> list[click.Parameter]:
    return [param for name, typed in _declared(function) for param in typed.parameters(name)]


_NAME = r"(?:--[\w-]+|[A-Z]{2,})"


def _require_others(ctx: click.Context) -> None:
    """Raise the usage error of an option whose help says that it would be ignored."""
    default, typed = click.core.ParameterSource.DEFAULT, click.core.ParameterSource.COMMANDLINE
    named = {
        p.opts[-1] if isinstance(p, click.Option) else p.human_readable_name.strip("[].…"): p
        for p in ctx.command.params
    }
    sources = {name: ctx.get_parameter_source(p.name or "") for name, p in named.items()}
    given = [name for name, source in sources.items() if source not in (default, None)]
    for option_name in (name for name in given if sources[name] is typed):
        lead = (getattr(named[option_name], "help", None) or "").partition(":")[0]
        needs, excludes = (
            re.findall(_NAME, " ".join(re.findall(rf"{word} {_NAME}(?:(?:, | or ){_NAME})*", lead)))
            if lead.startswith("With")
            else []
            for word in ("ith", "ithout")
        )
        if not named.keys().isdisjoint(needs) and set(given).isdisjoint(needs):
            any_of = " or ".join(needs)
            raise click.UsageError(
                f"{option_name} needs {any_of}; add {any_of}, or leave {option_name} out"
            )
        for other in (name for name in excludes if name in given):
            cause = f"{option_name} and {other} exclude each other"
            raise click.UsageError(f"{cause}; leave {option_name} out, or {other}")


class Command(click.Command):
    """A command whose options are those that the parameters of its function declare.

    `require` checks them together as soon as they are parsed: the queue parses a command when it is
    added, and begins it when nobody is there.
    """

    def __init__(
        self,
        callback: Callable[..., Any],
        params: Any,
        require: Callable[[Mapping[str, Any]], None] | None = None,
        **kw: Any,
    ) -> None:
        params = [*_parameters_of(callback), *params]
        super().__init__(callback=callback, params=params, **kw)
        self._require = require

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, and raise the usage error of options that do not belong together."""
        with augment_usage_errors(ctx):
            remaining = super().parse_args(ctx, args)
            if not ctx.resilient_parsing:
                _require_others(ctx)
                if self._require is not None:
                    self._require(ctx.params)
            return remaining

    def invoke(self, ctx: click.Context) -> Any:
        """Call the function, once each file that it is to write can be.

        Raises SmadError for what the plant refuses, as for all else.
        """
        try:
            return self._called(ctx)
        except Exception as error:
            # An error of the plant comes from there. Nothing is imported for any other: the way to
            # stop a bench must not depend on it.
            plant_errors = sys.modules.get("sim_device.plant.errors")
            if plant_errors is not None and isinstance(error, plant_errors.PlantError):
                raise SmadError(str(error)) from error
            raise

    def _called(self, ctx: click.Context) -> Any:
        require_outputs(ctx)
        assert self.callback is not None
        values = dict(ctx.params)
        for name, declared in _declared(self.callback):
            if isinstance(declared, _Together):
                fields = [field for field, _ in _declared(declared.kind)]
                record = declared.kind(**{field: values.pop(field) for field in fields})
                opens = hasattr(record, "open")
                values[name] = ctx.with_resource(record.open()) if opens else record
        return ctx.invoke(self.callback, **values)


class Group(click.Group):
    """A group of such commands."""

    command_class = Command


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


def require_outputs(context: click.Context, folder: Path = Path()) -> None:
    """Raise unless each file that a command is to write can be, and is no other file of it.

    Raises a usage error for a file that the command reads, or writes a second time.
    """
    files = [
        (parameter, path)
        for parameter in context.command.params
        for path in _files(context.params.get(parameter.name or ""))
    ]
    for parameter, path in files:
        if not isinstance(parameter.type, _Output):
            continue
        require_writable(folder / path)
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


json_option = flag("--json", "Print JSON.")
wait_option = flag("--wait/--no-wait", "Wait until it is done, or return at once.", default=True)
config_option = option(
    "--config", "Configuration file (smad config show).", PATH, envvar="SMAD_CONFIG"
)
lease_option = option(
    "--lease S",
    "On a real bench: the daemon disarms after this time without a message from this program.",
    Quantity("s", 0.5, 3600.0),
    default=2.0,
)
bench_option = option(
    "--bench", "Name of the bench, if there are several.", default="bench", envvar="SMAD_BENCH"
)
AXIS = "smad.axis"
"""Where the context of a command keeps the axis that was typed."""


def _remember(context: click.Context, parameter: click.Parameter, axis: str) -> None:
    context.meta[AXIS] = axis


_AXIS_OPTION = click.Option(
    ["--axis"],
    default="",
    show_default=False,
    envvar="SMAD_AXIS",
    expose_value=False,
    callback=_remember,
    help="The axis, if the bench has several.",
)
axis_option = replace(bench_option, others=(_AXIS_OPTION,))
"""`--bench` and `--axis`: what the command asks its client is for that axis."""


def port_option(usual: int) -> Any:
    """Return the option of a server's port."""
    return option(
        "--port", "TCP port on this machine; 0 takes any.", Whole(0, 65535), default=usual
    )


NEGATIVE = {"ignore_unknown_options": True}
"""Context of a command with numbers: without it, a -5 would be taken for an option."""


C = TypeVar("C", bound="Struct")


def checked(command: C, typed: Mapping[str, str]) -> C:
    """Return the command if its values are allowed; `typed`: how each field was given.

    Raises a usage error that names what was typed. The daemon checks it again.
    """
    from smad.config.bounds import refusal_of

    if (refused := refusal_of(command)) is not None:
        name, why = refused
        raise click.BadParameter(why, param_hint=repr(typed.get(name, name)))
    return command
