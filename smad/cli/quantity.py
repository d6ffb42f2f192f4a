"""Numbers with units on the command line: `5`, `5mm`, `2000mA`, `60C`."""

import math
import re
from collections.abc import Mapping
from typing import Any

import click

from sim_device.plant.units import UNITS
from smad.units import alternatives, in_words, range_in_words, spelt, units_for

_WITH_UNIT = "smad.typed_units"
_TYPED = re.compile(r"(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)")


class Quantity(click.FloatRange):
    """A number of `unit` within a range, with or without a unit of the same kind behind it.

    `unit` is empty for a number without one. `above` leaves the lower end out.
    """

    name = kind = "number"

    def __init__(
        self, unit: str = "", low: float = -math.inf, high: float = math.inf, *, above: bool = False
    ) -> None:
        super().__init__(low, high, min_open=above)
        self.unit = unit
        self.low, self.high = low, high

    def _describe_range(self) -> str:
        # The help shows it, and would write a range as `0.1<=x<=180.0`.
        words = range_in_words(self.low, self.high, self.unit, above=self.min_open)
        ratio = self.unit == "1" and not self.min_open and math.isfinite(self.high - self.low)
        return f"{words} ({self.low:.0%} to {self.high:.0%})" if ratio else words

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number in `unit`. Fails as a usage error that names the units allowed."""
        if isinstance(value, int | float):
            return float(value)
        text = str(value).strip()
        if re.match(r"[-+]?\d*,\d", text):
            self.fail(f"{value!r}: a number has a decimal point and no comma, as 1.5.", param, ctx)
        match, unit_words = _TYPED.fullmatch(text), in_words(self.unit)
        unit = spelt(match["unit"]) if match else ""
        try:
            number = float(match["number"] if match and (self.unit or not unit) else text)
        except ValueError:
            of = f" of {unit_words}" if unit_words else ""
            self.fail(f"{value!r} is not a {self.kind}{of}.", param, ctx)
        if unit and unit not in units_for(self.unit):
            allowed = alternatives(self.unit)
            self.fail(f"{value!r}: give it in {unit_words}, alone or with {allowed}.", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        if unit and ctx is not None and param is not None:
            ctx.meta[_WITH_UNIT] = {**typed_units(ctx), param.name: unit}
        if unit and unit != self.unit:
            number = UNITS[self.unit].from_si(UNITS[unit].to_si(number))
        # 250 ms are 0.25 s, not 0.25000000000000006.
        number = float(f"{number:.15g}")
        if not self.low <= number <= self.high or (self.min_open and number == self.low):
            one_sided = self.min_open or math.isinf(self.high - self.low)
            within = "" if one_sided else "within "
            self.fail(f"{value!r} is not {within}{self._describe_range()}.", param, ctx)
        return number


class Whole(Quantity):
    """A whole number within a range."""

    name, kind = "integer", "whole number"

    def __init__(self, low: int, high: float = math.inf) -> None:
        super().__init__("", low, high)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number. Fails as a usage error."""
        number = super().convert(value, param, ctx)
        if not number.is_integer():
            self.fail(f"{value!r} is not a {self.kind}.", param, ctx)
        return int(number)


def typed_units(ctx: click.Context) -> Mapping[str | None, str]:
    """Return the units that were typed, by the name of the parameter."""
    units: Mapping[str | None, str] = ctx.meta.get(_WITH_UNIT, {})
    return units
