"""The sizes of a diagnosis, and the constants of its decision, which a command writes."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field, fields
from importlib.resources import files
from typing import Any

_CHOSEN = tomllib.loads((files("smad.gap") / "decision.toml").read_text())
_NINE_IN_TEN = 1.2816
"""Standard deviations below its mean that a normal variable exceeds nine times in ten."""


def _of(group: str) -> Any:
    """A field of this group, by value and meaning."""

    def named(value: float, meaning: str) -> Any:
        return field(default=value, metadata={"group": group, "meaning": meaning})

    return named


def _chosen(group: str, table: str) -> Any:
    """A field of this group, by its name in a table of `decision.toml`, and meaning."""
    add = _of(group)
    return lambda name, meaning: add(float(_CHOSEN[table][name]), meaning)


_size = _of("Sizes")
_decision = _chosen("Decision", "decision")
_right = _chosen("Shares of answers right since known-good runs, as measured", "right")


@dataclass(frozen=True, slots=True)
class Settings:
    """Frozen before a sealed bank is opened; a report carries the values it was made with.

    docs/diagnosis.md lists them.
    """

    period_s: float = _size(0.1, "the analysis grid in s: samples are averaged over it")
    block_s: float = _size(5.0, "a cell in s: its scale is judged as a whole")
    cell_dof: float = _size(
        10.0,
        "weight, in samples, of a cell's scale being the floor's: small ones soften a misfit",
    )
    seed: int = _size(0, "of everything random")
    max_effects: int = _size(3, "causes that may be named together")
    min_duration_s: float = _size(8.0, "least length of a run in s")
    min_excess: float = _size(
        0.35, "floors below which a gap counts as none: the floor itself is known to 6 %"
    )
    since_gain: float = _decision(
        "since_gain", "since known-good runs: nats for each judged cell that a cause must gain"
    )
    standard_errors: float = _decision(
        "standard_errors", "by which a held-out score must be better to count"
    )
    least_share: float = _decision(
        "least_share",
        "the least share that counts: of a gap, for a cause or a rest; of the effects, that show",
    )
    most_share: float = _decision(
        "most_share",
        "of what a flexible correction takes, that a cause must take; of the gap, that a refit"
        " must take",
    )
    nearly_all: float = _decision(
        "nearly_all", "of what a clearly better free refit gains, that a cause must bring to stand"
    )
    since_spreads: float = _decision(
        "since_spreads",
        "without a cause, since good runs: by what one output differs, in what these differ in it",
    )
    odds: float = _decision("odds", "between two causes from which on they are told apart")
    form_share: float = _decision(
        "form_share", "of what a cause changes, by which a law of another form may differ"
    )
    quiet_right: float = _right("quiet", "no gap, parameters only")
    named_right: float = _right("named", "a named cause")
    unsure_right: float = _right("unsure", "unknown, or a cause that other parameters imitate")


def enough_d2(odds: float) -> float:
    """Separation d² from which on the odds of two models exceed `odds` nine times in ten.

    Their logarithm is normal with mean d²/2 and variance d².
    """
    return (_NINE_IN_TEN + math.sqrt(_NINE_IN_TEN**2 + 2.0 * math.log(odds))) ** 2


def shipped() -> dict[str, tuple[str, float, str]]:
    """Group, value and meaning of every setting, by name."""
    return {
        f.name: (f.metadata["group"], f.default, f.metadata["meaning"])  # type: ignore[misc]
        for f in fields(Settings)
    }
