"""An experiment as data: what to command, what to wait for, and names for the moments between.

The same plan runs in virtual time (`smad.control.runner`) and on a daemon (`smad.experiments`).
"""

from dataclasses import dataclass
from typing import Literal

from smad.control.commands import ModeCommand

Fixture = Literal["antagonistic", "stretch", "blocked"]
Cooling = Literal["water", "air"]


@dataclass(frozen=True)
class Do:
    """Give a command and go on."""

    command: ModeCommand


@dataclass(frozen=True)
class UntilDone:
    """Wait until what was commanded has ended.

    An end that never comes is an error after `timeout_s` of board time.
    """

    timeout_s: float


@dataclass(frozen=True)
class Pause:
    """Let so many seconds of board time pass."""

    seconds: float


@dataclass(frozen=True)
class Mark:
    """Name this moment, for the analysis."""

    name: str


Action = Do | UntilDone | Pause | Mark


@dataclass(frozen=True)
class Plan:
    """One run, from rest, of springs mounted as `fixture` and `cooling` say (air: no module).

    `repeats` stands in the run's header: the run whose inputs it plays again.
    """

    name: str
    actions: tuple[Action, ...]
    fixture: Fixture = "antagonistic"
    cooling: Cooling = "water"
    repeats: str = ""
