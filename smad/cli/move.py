"""`smad move`: trajectories of the displacement loop, a command for each kind of piece."""

import contextlib
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import click
import msgspec
from msgspec import inspect as types

from smad.cli.options import (
    NEGATIVE,
    PATH,
    Group,
    argument,
    axis_option,
    checked,
    flag,
    wait_option,
)
from smad.cli.output import carry_out, client
from smad.cli.quantity import Quantity, typed_units
from smad.config.axes import millimetres
from smad.config.fields import bare, info_of
from smad.control.commands import PIECES, Piece, Trajectory
from smad.errors import SmadError
from smad.records.points import read_samples
from smad.units import parted_name

_queue_option = flag(
    "--queue", "Append to the present motion instead of replacing it; returns at once."
)
_COMMON = [
    *_queue_option.parameters("queue"),
    *wait_option.parameters("wait"),
    *axis_option.parameters("bench"),
]
_DEGREES = click.Option(
    ["--deg", "unit_mm"],
    callback=lambda context, parameter, given: millimetres(1.0) if given else 1.0,
    is_flag=True,
    help="Give lengths in degrees of the MINIR-II segment, not in mm (25 degrees are 4 mm).",
)
_LENGTHS = ("_mm_per_s", "_mm")


@click.group(cls=Group)
def move() -> None:
    """Move the pair along a trajectory. Positive displacement: spring X pulls."""


def command_of(piece: type[Piece]) -> click.Command | None:
    """Return the command that sends such a piece; None if some field is no single value."""
    info = info_of(piece)
    fields = [(field, *bare(field.type)) for field in info.fields]
    values = [_VALUES.get(type(kind)) for _, kind, _ in fields]
    if None in values:
        return None
    names = [field.name for field in info.fields]
    lengths = [name for name in names if name.endswith(_LENGTHS)]
    parameters = [
        _parameter(field, value, meta)
        for (field, _, meta), value in zip(fields, values, strict=True)
    ]

    typed = {
        name: parameter.human_readable_name
        if isinstance(parameter, click.Argument)
        else parameter.opts[0]
        for name, parameter in zip(names, parameters, strict=True)
    }

    def send(*, unit_mm: float = 1.0, queue: bool, wait: bool, bench: str, **params: Any) -> None:
        # click knows its arguments in lower case only.
        named = {name: params[name] if name in params else params[name.lower()] for name in names}
        units = typed_units(click.get_current_context())
        for name in lengths if unit_mm != 1.0 else ():
            if typed_unit := units.get(name) or units.get(name.lower()):
                raise click.BadParameter(
                    f"a length in {typed_unit} contradicts --deg", param_hint=repr(typed[name])
                )
        scaled = {name: named[name] * unit_mm for name in lengths}
        try:
            trajectory = checked(piece(**{**named, **scaled}), typed)
        except click.BadParameter as refused:
            of_length = [name for name in lengths if repr(typed[name]) == refused.param_hint]
            if of_length and (limit := _limit_of_bench(bench, of_length[0])):
                raise click.BadParameter(
                    f"{refused.message}; this bench allows {limit}", param_hint=refused.param_hint
                ) from None
            raise
        _send(cast("Trajectory", trajectory), queue=queue, wait=wait, bench=bench)

    arguments = [
        f"{parameter.human_readable_name}: {meta.get('description', '')}"
        for parameter, (_, _, meta) in zip(parameters, fields, strict=True)
        if isinstance(parameter, click.Argument)
    ]
    return click.Command(
        piece.word or str(piece.__struct_config__.tag).replace("_", "-"),
        params=[*parameters, *([_DEGREES] if lengths else []), *_COMMON],
        callback=send,
        help="\n\n".join([inspect.getdoc(piece) or "", "\b\n" + "\n".join(arguments)]),
        context_settings=NEGATIVE,
    )


def _limit_of_bench(bench: str, field: str) -> str:
    """Return how far or fast the running bench may be moved, in words; empty where none answers."""
    from smad.config import parse_config

    with contextlib.suppress(SmadError), client(bench) as bench_client:
        return parse_config(bench_client.config()).limits.in_words(field)
    return ""


_VALUES: dict[type[types.Type], click.ParamType[Any]] = {
    types.FloatType: click.FLOAT,
    types.IntType: click.INT,
    types.BoolType: click.BOOL,
    types.StrType: click.STRING,
}


def _parameter(
    field: types.Field, value: click.ParamType[Any] | None, meta: Mapping[str, Any]
) -> click.Parameter:
    usual = meta.get("usual", field.default)
    stem, unit = parted_name(field.name)
    if value is click.FLOAT and unit:
        value = Quantity(unit)
    if usual is msgspec.NODEFAULT:
        return click.Argument([field.name], type=value, metavar=field.name.upper())
    name = meta.get("option", stem.replace("_", "-"))
    text = str(meta.get("description", "")).capitalize() + "."
    if value is click.BOOL:
        return click.Option([f"--{name}", field.name], is_flag=True, help=text)
    return click.Option(
        [f"--{name}", field.name],
        type=value,
        default=usual,
        help=text,
        metavar=unit.upper() or None,
    )


@move.command(context_settings=NEGATIVE)
def follow(
    *,
    path: Path = argument(PATH),
    queue: bool = _queue_option,
    wait: bool = wait_option,
    bench: str = axis_option,
) -> None:
    """Follow the points of a CSV file.

    Its columns are t_s and displacement_mm, or angle_deg for angles of the segment.
    """
    _send(read_samples(path), queue=queue, wait=wait, bench=bench)


def _send(trajectory: Trajectory, *, queue: bool, wait: bool, bench: str) -> None:
    with client(bench) as bench_client:
        wait, what = wait and not queue, type(trajectory).__name__.lower()
        carry_out(bench_client, bench_client.move, trajectory, queue=queue, wait=wait, what=what)


for _piece in PIECES:
    if (_command := command_of(_piece)) is not None:
        move.add_command(_command)
