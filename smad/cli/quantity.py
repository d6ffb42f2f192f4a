"""Numbers with units on the command line: `5`, `5mm`, `2000mA`, `60C`."""

import math
import re
from collections.abc import Mapping
from typing import Any

import click

from sim_device.plant.units import UNITS
from smad.units import alternatives, in_words, spelt, units_for

_WITH_UNIT = "smad.typed_units"
_TYPED = re.compile(r"(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)")


class Quantity(click.ParamType[float]):
    """A number of `unit` within a range, with or without a unit of the same kind behind it."""

    name = "number"

    def __init__(self, unit: str, low: float = -math.inf, high: float = math.inf) -> None:
        self.unit = unit
        self.low, self.high = low, high

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number in `unit`. Fails as a usage error that names the units allowed."""
        if isinstance(value, int | float):
            return float(value)
        text = str(value).strip()
        match, shown = _TYPED.fullmatch(text), in_words(self.unit)
        try:
            number = float(match["number"] if match else text)
        except ValueError:
            self.fail(f"{value!r} is not a number of {shown}.", param, ctx)
        unit = spelt(match["unit"]) if match else ""
        if unit and unit not in units_for(self.unit):
            allowed = alternatives(self.unit)
            self.fail(f"{value!r}: give it in {shown}, alone or with {allowed}.", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        if unit and ctx is not None and param is not None:
            ctx.meta[_WITH_UNIT] = {**typed_units(ctx), param.name: unit}
        if unit and unit != self.unit:
            number = UNITS[self.unit].from_si(UNITS[unit].to_si(number))
        # 250 ms are 0.25 s, not 0.25000000000000006.
        number = float(f"{number:.15g}")
        if not self.low <= number <= self.high:
            self.fail(f"{value!r} is not within {self.low:g} to {self.high:g} {shown}.", param, ctx)
        return number


def typed_units(ctx: click.Context) -> Mapping[str | None, str]:
    """Return the units that were typed, by the name of the parameter."""
    units: Mapping[str | None, str] = ctx.meta.get(_WITH_UNIT, {})
    return units
