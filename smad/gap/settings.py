"""The sizes of a diagnosis and the thresholds of its verdicts."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


def _of(group: str) -> Any:
    """A field of this group, by value and meaning."""

    def named(value: float, meaning: str) -> Any:
        return field(default=value, metadata={"group": group, "meaning": meaning})

    return named


_size = _of("Sizes")
_entering = _of("Entering")
_free = _of("Cause or parameters")
_unknown = _of("Unknown")
_verdict = _of("Verdict")
_right = _of("Probabilities since known-good runs: shares right on the development bank")


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
    significance: float = _entering(0.01, "how often chance alone may beat a candidate")
    since_gain: float = _entering(1.0, "since known-good runs: nats for each judged cell")
    standard_errors: float = _entering(2.0, "by which a held-out score must be better to count")
    min_shrink_gain: float = _entering(
        0.1,
        "what a cause adds to the shrink on its signals or in all, and all causes in all",
    )
    imitated_share: float = _free(
        0.9, "of what a clearly better free refit gains, that a cause must bring to stand"
    )
    imitated_gain: float = _free(
        1.5,
        "nats a cell for a name at even odds where the free refit is no worse",
    )
    vanished_share: float = _free(
        0.55, "parameters have changed if the refit leaves less than this share of the gap"
    )
    min_excess: float = _unknown(0.35, "floors below which a gap is not significant")
    unknown_shrink: float = _unknown(0.2, "a cause that takes less of the gap is unknown")
    unknown_ratio: float = _unknown(
        0.5, "or less than this share of what a flexible correction takes"
    )
    since_spreads: float = _unknown(
        8.0,
        "without a cause, since good runs: by what one output differs, in what these differ in it",
    )
    lone_ratio: float = _unknown(
        2.0, "the same since a single good run: the multiple of the threshold that is left"
    )
    least_visible: float = _verdict(
        0.2, "share of the effects that must show, or the runs excite too little"
    )
    rest_margin: float = _verdict(
        0.15,
        "share of the gap that a flexible correction takes beyond the cause, called a rest",
    )
    ambiguous_odds: float = _verdict(
        10.0, "odds between two causes from which on they are told apart"
    )
    ambiguous_d2: float = _verdict(16.0, "separation d² from which on two causes are told apart")
    form_share: float = _verdict(
        0.35, "by which a law of another form widens the interval of a strength, in quadrature"
    )
    quiet_right: float = _right(0.4, "no gap, parameters only")
    named_right: float = _right(0.75, "a named cause")
    unsure_right: float = _right(0.5, "unknown, or a cause that other parameters imitate")


def shipped() -> dict[str, tuple[str, float, str]]:
    """Group, value and meaning of every setting, by name."""
    return {
        f.name: (f.metadata["group"], f.default, f.metadata["meaning"])  # type: ignore[misc]
        for f in fields(Settings)
    }
