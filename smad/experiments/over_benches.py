"""The displacement loop over many simulated benches: what tools/control_campaign.py measured.

The shipped file has a line of JSON for each case: a bench (`bench`, `kind`) at a sample rate and a
factor of the sensors' noise (`rate_Hz`, `noise`), with what was measured with the `shipped` gains
and after tuning (`tuned`, null where it was not tried or was `refused`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

DATA = "data/benches.jsonl"
GAINS = ("shipped", "tuned")
LEVELS_MM = (0.0, 5.0, -10.0)
KINDS = ("set A", "set B", "drawn", "drawn around set B")
"""What a bench may be: one of the two published sets, or drawn."""
HELD = ("starts", "swings", "ripple_mA", "error_um")
"""What each hold has a value of."""


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
    "swings": Quantity("swings of more than ±10 µm in a hold", True, "{:.0f}"),
    "ripple_mA": Quantity("ripple in a hold, mA", True, "{:.0f}"),
    "error_um": Quantity("error of a hold, µm", True, "{:.1f}"),
}


Case = Mapping[str, Any]
"""A line of the shipped file."""


@dataclass(frozen=True)
class Group:
    """Benches measured under the same conditions; `values` by gains and quantity.

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
        many = f", {self.benches} simulated benches" if self.benches > 1 else ""
        return f"{self.kind}{many}, {self.rate_Hz} Hz, noise ×{self.noise:g}"


def was_tuned(case: Case) -> bool:
    """Whether tuning was tried on this bench."""
    return bool(case["tuned"] or case["refused"])


def read_cases(text: str) -> list[dict[str, Any]]:
    """The cases of a file, but for those whose run failed."""
    found: list[dict[str, Any]] = [json.loads(line) for line in text.splitlines()]
    return [case for case in found if case["shipped"]]


def groups(cases: Sequence[Case] | None = None) -> list[Group]:
    """The cases by kind, rate and noise; those of the shipped file by default."""
    if cases is None:
        cases = read_cases(resources.files("smad.experiments").joinpath(DATA).read_text())
    alike: dict[tuple[str, int, float], list[Case]] = {}
    for c in sorted(cases, key=lambda c: (KINDS.index(c["kind"]), c["rate_Hz"], c["noise"])):
        alike.setdefault((c["kind"], c["rate_Hz"], c["noise"]), []).append(c)
    return [_group(*key, part) for key, part in alike.items()]


def _group(kind: str, rate_Hz: int, noise: float, part: Sequence[Case]) -> Group:
    by_gains = {"shipped": [c["shipped"] for c in part]}
    tuned = all(was_tuned(c) for c in part)
    if tuned:
        # Who is refused keeps the gains that there are.
        by_gains["tuned"] = [c["tuned"] or c["shipped"] for c in part]
    refused = sum(bool(c["refused"]) for c in part) if tuned else 0
    of_gains = {
        name: {key: values(results, key) for key in QUANTITIES}
        for name, results in by_gains.items()
    }
    return Group(kind, rate_Hz, noise, len(part), refused, of_gains)


def values(results: Sequence[Mapping[str, Any]], key: str) -> list[float]:
    """The values of a quantity, sorted; of a hold the worst of the levels that were reached."""
    if key in HELD:
        levels = [[r[f"hold {level:g}"] for level in LEVELS_MM] for r in results]
        reached = [[h[key] for h in holds if h["reached"]] for holds in levels]
        found = [max(holds) for holds in reached if holds]
    else:
        found = [math.nan if r[key] is None else r[key] for r in results]
    return sorted(found, key=lambda v: math.inf if math.isnan(v) else v)


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
