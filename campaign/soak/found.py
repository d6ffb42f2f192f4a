"""What a soak is asked to do and what came of it, as plain records. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from campaign.scripted_client import Acknowledged
from smad.api import METHODS

Rate = Literal[100, 500]
Logged = tuple[str, dict[str, Any]]

LOOKING = frozenset(method.name for method in METHODS if not method.logged)
"""Methods that change nothing of the bench or its log."""


@dataclass(frozen=True)
class Stage:
    """So much board time at a rate, and how often things happen in it (s of board time)."""

    rate_hz: Rate
    seconds: float
    reconnect_every_s: float = 60.0
    flood_every_s: float = 60.0
    flood: int = 2000
    look_every_s: float = 10.0

    @property
    def name(self) -> str:
        """The stage in words."""
        return f"{self.seconds:g} s at {self.rate_hz} Hz"


FULL = (Stage(100, 3600.0), Stage(500, 600.0))
"""An hour at 100 Hz and ten minutes at 500 Hz."""


@dataclass(frozen=True)
class Usage:
    """What the daemon's process holds at a moment of board time (s)."""

    at_s: float
    rss_MiB: float
    descriptors: int
    threads: int


@dataclass
class StageResult:
    """What a stage gave. Times in s; `faults` are those that the board latched, in their order."""

    stage: Stage
    seed: int
    board_s: float = 0.0
    wall_s: float = 0.0
    samples: int = 0
    missed: int = 0
    skipped: int = 0
    reconnects: int = 0
    losses: int = 0
    host_timeouts: int = 0
    armings: int = 0
    flooded: int = 0
    flood_answered: int = 0
    telemetry_read: int = 0
    commands: Acknowledged = field(default_factory=Acknowledged)
    faults: list[str] = field(default_factory=list)
    usage: list[Usage] = field(default_factory=list)
    recorded_rows: int = 0
    logged_rows: int = 0
    logged_gaps: int = 0
    log_dropped: int = 0
    log_error: str = ""
    not_logged: list[str] = field(default_factory=list)
    status: int = -1
    last_line: str = ""


def not_logged(acknowledged: Sequence[Logged], logged: Sequence[Logged]) -> list[str]:
    """The acknowledged commands that the log lacks, or has in another order, in words."""
    missing = []
    position = 0
    for method, details in acknowledged:
        if method in LOOKING:
            continue
        try:
            position = logged.index((method, details), position) + 1
        except ValueError:
            missing.append(f"{method} {details}")
    return missing
