"""A value that its type does not allow, told without the words of a schema. Pure."""

import math
import re
from typing import Any

import msgspec

from smad import units
from smad.counted import counted

_BOUND = re.compile(r"Expected `(?:float|int)` (?P<side>[<>]=?) (?P<limit>[-+.0-9e]+)")
_KIND = re.compile(r"Expected `(?P<wanted>[a-z]+)`, got `(?P<given>[a-z]+)`")
_KINDS = {
    "bool": "true or false",
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "array": "a list",
    "object": "a table of names and values",
    "null": "nothing",
}
"""Types of a schema, as a person calls what they allow."""
_LENGTH = re.compile(r"Expected `(?P<kind>array|str)` of length (?P<side>[<>]=?) (?P<limit>\d+)")
_SIDES = {"<=": "at most", ">=": "at least", "<": "below", ">": "above"}


def in_words(cause: str) -> str:
    """Return what msgspec says of a range or a type in words; anything else as it is."""
    bound = _BOUND.fullmatch(cause)
    if bound is not None:
        return f"it has to be {_SIDES[bound['side']]} {float(bound['limit']):g}"
    if length := _LENGTH.fullmatch(cause):
        side, size = _SIDES[length["side"]], int(length["limit"])
        if length["kind"] == "array":
            return f"it has to be a list of {side} {size}"
        return f"it has to be text of {side} {counted(size, 'character')}"
    kind = _KIND.fullmatch(cause)
    if kind is None or kind["wanted"] not in _KINDS:
        return cause
    given = _KINDS.get(kind["given"], kind["given"])
    return f"it has to be {_KINDS[kind['wanted']]}, not {given}"


def field_and_words(message: str) -> tuple[str, str]:
    """Return where msgspec found a value that is not allowed (`a[2].b`, or empty), and why."""
    cause, _, path = message.partition(" - at `$")
    return path.rstrip("`").removeprefix("."), in_words(cause)


def refusal_of(command: msgspec.Struct) -> tuple[str, str] | None:
    """Return the field of a command whose value is not allowed, and why; None: all are."""
    values = msgspec.to_builtins(command)
    for name, value in values.items():
        if isinstance(value, float) and not math.isfinite(value):
            return name, f"{value:g} is not a finite number"
    try:
        msgspec.convert(values, type(command))
    except msgspec.ValidationError as error:
        name, bound = field_and_words(str(error))
        unit, value = f" {units.in_words(units.unit_of(name))}".rstrip(), values.get(name)
        typed = units.quantity(name, value) if isinstance(value, int | float) else repr(value)
        return name, f"{typed}: {bound}{unit}"
    return None


def value_at(value: Any, path: str) -> Any:
    """Return what stands at such a path in a value of JSON; None where there is nothing."""
    for part in filter(None, path.replace("[", ".").replace("]", "").split(".")):
        try:
            value = value[int(part)] if isinstance(value, list | tuple) else value[part]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
    return value
