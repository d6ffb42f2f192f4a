"""What a run of one target came to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """An input on which the target broke a promise, and how."""

    kind: str
    text: str
    data: bytes


@dataclass(frozen=True)
class Outcome:
    """What a run of one target came to.

    `edges` of the `counters` in the instrumented packages were reached, `edges_before` of them by
    the corpus alone; `features` tells apart how often, too. All are zero without atheris. `grown`
    holds the inputs that reached something new.
    """

    target: str
    executions: int
    seconds: float
    inputs_before: int
    inputs: int
    findings: tuple[Finding, ...]
    edges_before: int = 0
    edges: int = 0
    counters: int = 0
    features_before: int = 0
    features: int = 0
    slowest_s: int = 0
    peak_MiB: int = 0
    grown: tuple[bytes, ...] = ()
