"""The displacement loop over many simulated benches: what tools/control_campaign.py measured."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

DATA = "data/benches.json"
GAINS = ("shipped", "tuned")


@dataclass(frozen=True)
class Quantity:
    """What was measured, in words; whether much of it is bad; how a value is printed."""

    words: str
    much_is_bad: bool
    form: str


QUANTITIES = {
    "r2": Quantity("R² of 2 mm, 7 s", False, "{:.3f}"),
    "settling_s": Quantity("settling of 2 mm to 2 %, s", True, "{:.2f}"),
    "overshoot": Quantity("overshoot of 2 mm, %", True, "{:.2f}"),
    "energy_J": Quantity("energy a cycle, J", True, "{:.0f}"),
    "cycle_starts": Quantity("pump starts a cycle", True, "{:.1f}"),
    "starts": Quantity("pump starts in a hold of 60 s", True, "{:.0f}"),
    "turns": Quantity("changes of direction in a hold", True, "{:.0f}"),
    "ripple_mA": Quantity("ripple in a hold, mA", True, "{:.0f}"),
    "error_um": Quantity("error of a hold, µm", True, "{:.1f}"),
}


@dataclass(frozen=True)
class Group:
    """Benches measured under the same conditions; `values` by gains and quantity, sorted.

    A bench that tuning refused counts with the shipped gains there too. nan: it never got there.
    """

    kind: str
    rate_Hz: int
    noise: float
    benches: int
    refused: int
    values: Mapping[str, Mapping[str, Sequence[float]]]

    @property
    def title(self) -> str:
        """Which benches under which conditions."""
        many = f", {self.benches} benches" if self.benches > 1 else ""
        return f"{self.kind}{many}, {self.rate_Hz} Hz, noise ×{self.noise:g}"


def groups() -> list[Group]:
    """The groups of the shipped file."""
    text = resources.files("smad.experiments").joinpath(DATA).read_text()
    return [Group(**with_nan(entry)) for entry in json.loads(text)]


def with_nan(entry: dict[str, Any]) -> dict[str, Any]:
    """JSON has no nan; null stands for it."""
    values = {
        gains: {key: [math.nan if v is None else v for v in found] for key, found in keys.items()}
        for gains, keys in entry["values"].items()
    }
    return entry | {"values": values}


def table(found: Sequence[Group]) -> str:
    """Markdown: a line for each group and gains, a column for each quantity.

    Single benches in one table; of many benches median, bad 5 % and worst in another.
    """
    one, many = ([g for g in found if (g.benches == 1) is alone] for alone in (True, False))
    return "\n".join([*_lines(one, "bench"), "", *_lines(many, "median, bad 5 %, worst of"), ""])


def _lines(found: Sequence[Group], head: str) -> Iterator[str]:
    heads = [quantity.words for quantity in QUANTITIES.values()]
    yield f"| {head} | gains | " + " | ".join(heads) + " |"
    yield "|---|---|" + "---:|" * len(heads)
    for group in found:
        refused = f", {group.refused} refused by tuning" if group.refused else ""
        for gains in (name for name in GAINS if name in group.values):
            values = group.values[gains]
            cells = [_cell(values[key], q, one=group.benches == 1) for key, q in QUANTITIES.items()]
            yield f"| {group.title}{refused} | {gains} | " + " | ".join(cells) + " |"


def _cell(values: Sequence[float], quantity: Quantity, *, one: bool) -> str:
    ordered = sorted(values, key=lambda v: math.inf if math.isnan(v) else v)
    if not quantity.much_is_bad:
        ordered = ordered[::-1]
    last = len(ordered) - 1
    if last < 0:
        return "–"
    at = (0,) if one else (len(ordered) // 2, round(0.95 * last), last)
    return ", ".join(
        "never" if math.isnan(ordered[k]) else quantity.form.format(ordered[k]) for k in at
    )
