"""Numbers with units on the command line: `5`, `5mm`, `2000mA`, `60C`."""

import math
import re
from collections.abc import Mapping
from typing import Any

import click

UNITS: Mapping[str, Mapping[str, float]] = {
    "mm": {"mm": 1.0, "cm": 10.0, "m": 1000.0, "µm": 1e-3, "um": 1e-3},
    "mm/s": {"mm/s": 1.0, "cm/s": 10.0, "m/s": 1000.0},
    "A": {"A": 1.0, "mA": 1e-3},
    "°C": {"°C": 1.0, "C": 1.0, "degC": 1.0},
    "K/s": {"K/s": 1.0, "C/s": 1.0, "°C/s": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "Hz": {"Hz": 1.0, "mHz": 1e-3},
}
"""Unit of a command -> what may be typed, and how many of that unit it is."""
_WITH_UNIT = "smad.typed_units"
_TYPED = re.compile(r"(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)")


class Quantity(click.ParamType[float]):
    """A number of `unit`, with or without a unit of the same kind behind it."""

    name = "number"

    def __init__(self, unit: str) -> None:
        self.unit = unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number in `unit`. Fails as a usage error that names the units allowed."""
        if isinstance(value, int | float):
            return float(value)
        text = str(value).strip()
        match, units = _TYPED.fullmatch(text), UNITS[self.unit]
        try:
            number = float(match["number"] if match else text)
        except ValueError:
            self.fail(f"{value!r} is not a number of {self.unit}.", param, ctx)
        unit = match["unit"] if match else ""
        if unit and unit not in units:
            allowed = ", ".join(units)
            self.fail(f"{value!r}: give it in {self.unit}, alone or with {allowed}.", param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        if unit and ctx is not None and param is not None:
            ctx.meta[_WITH_UNIT] = {**typed_units(ctx), param.name: unit}
        # 250 ms are 0.25 s, not 0.25000000000000006.
        return float(f"{number * units.get(unit, 1.0):.15g}")


def typed_units(ctx: click.Context) -> Mapping[str | None, str]:
    """Return the units that were typed, by the name of the parameter."""
    units: Mapping[str | None, str] = ctx.meta.get(_WITH_UNIT, {})
    return units
