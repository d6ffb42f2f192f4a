"""Forms made from the types of the commands: a new trajectory needs no change here.

Pure. What a form lets through is checked again by the daemon; the bounds here spare a round trip.
"""

import inspect
from collections.abc import Mapping
from typing import Any, Literal, get_args

import msgspec
from msgspec import Struct
from msgspec import inspect as types

from smad.config import Config
from smad.config.fields import bare, info_of
from smad.control.commands import Samples, Trajectory, Tune
from smad.control.inforce import tune_of
from smad.units import in_words, parted_name

Kind = Literal["number", "whole", "choice", "switch"]

WITHOUT_FORM = frozenset({Samples})
"""Hundreds of points are for a file: `smad move follow`."""

TYPICAL: Mapping[str, float] = {
    "displacement_mm": 2.0,
    "amplitude_mm": 2.0,
    "offset_mm": 0.0,
    "step_mm": 1.0,
    "duration_s": 10.0,
    "period_s": 7.0,
    "dwell_s": 5.0,
    "rate_mm_per_s": 1.0,
    "start_Hz": 0.05,
    "end_Hz": 0.2,
    "cycles": 3,
    "steps": 4,
    "levels": 5,
    "seed": 0,
}
"""What a field without a default begins with: something that a bench in order can follow."""

GAIN_HEADROOM = 4.0
"""The slider of a gain goes from zero to so many times the configured one."""


class Field(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One input. Bounds are inclusive unless `above` says that the least is not allowed itself.

    `slider` is the range of a slider beside the input, where there is one.
    """

    name: str
    label: str
    unit: str
    kind: Kind
    about: str
    initial: float | bool | str | None = None
    least: float | None = None
    most: float | None = None
    above: bool = False
    choices: tuple[str, ...] = ()
    slider: float | None = None


class Form(Struct, frozen=True, kw_only=True):
    """The inputs of one type. `tag` is what marks the type in JSON."""

    tag: str
    title: str
    about: str
    fields: tuple[Field, ...]


def trajectories() -> tuple[Form, ...]:
    """Return a form for each piece of motion."""
    kinds = (kind for kind in get_args(Trajectory) if kind not in WITHOUT_FORM)
    return tuple(form_of(kind) for kind in kinds)


def tuning(config: Config) -> Form:
    """Return the form of the gains, beginning at those of the configuration."""
    in_force = msgspec.structs.asdict(tune_of(config.control))
    form = form_of(Tune)
    fields = tuple(
        msgspec.structs.replace(field, initial=in_force[field.name], **_slider(field, in_force))
        for field in form.fields
    )
    return msgspec.structs.replace(form, fields=fields)


def form_of(struct: type[Struct], *, skip: bool = False) -> Form:
    """Return the form of a type whose fields are numbers, switches and choices.

    Another field raises TypeError; with `skip` it is left at its default.
    """
    info = info_of(struct)
    tag = str(info.tag)
    fields = []
    for field in info.fields:
        try:
            fields.append(_field(field))
        except TypeError:
            if not skip:
                raise
    return Form(
        tag=tag,
        title=tag.replace("_", " "),
        about=(inspect.getdoc(struct) or "").partition("\n")[0],
        fields=tuple(fields),
    )


def _slider(field: Field, in_force: Mapping[str, Any]) -> dict[str, float]:
    value = in_force[field.name]
    if field.kind != "number":
        return {}
    if field.name == "current_limit_A":
        # Never above the configured one: the daemon refuses it.
        return {"slider": value, "most": value}
    most = field.most if field.most is not None else GAIN_HEADROOM
    return {"slider": min(most, GAIN_HEADROOM * value or GAIN_HEADROOM)}


def _field(field: types.Field) -> Field:
    # "or nothing": left out when it was not touched.
    kind, meta = bare(field.type)
    initial = None if field.default is msgspec.NODEFAULT else field.default
    stem, unit = parted_name(field.name)
    entry = Field(
        name=field.name,
        label=stem.replace("_", " "),
        unit=in_words(unit),
        kind="number",
        about=meta.get("description", ""),
        initial=initial,
    )
    match kind:
        case (
            types.FloatType(gt=above, ge=least, le=most)
            | types.IntType(gt=above, ge=least, le=most)
        ):
            return msgspec.structs.replace(
                entry,
                kind="whole" if isinstance(kind, types.IntType) else "number",
                initial=TYPICAL.get(field.name) if initial is None else initial,
                least=least if above is None else above,
                most=most,
                above=above is not None,
            )
        case types.BoolType():
            return msgspec.structs.replace(entry, kind="switch", initial=bool(initial))
        case types.LiteralType(values=values):
            return msgspec.structs.replace(entry, kind="choice", choices=tuple(map(str, values)))
    raise TypeError(f"{field.name}: no input is known for {kind}")
