"""The bench as commands and status see it: its axes by name, and what it has once for all."""

from collections.abc import Mapping
from dataclasses import dataclass

from smad.api import Reason
from smad.config import Config
from smad.daemon.axis import Axis
from smad.daemon.command.lease import DeadMan, Lease
from smad.daemon.errors import Refusal
from smad.daemon.journal import Journal
from smad.daemon.realtime import IdleCollector
from smad.daemon.services import Services
from smad.daemon.stops import Stops
from smad.daemon.telemetry.blackbox import BlackBox
from smad.daemon.telemetry.recorder import Recorder
from smad.daemon.together import Groups


@dataclass
class CommandCounts:
    """Commands carried out and refused; `malformed` are those refused that were no command."""

    done: int = 0
    refused: int = 0
    malformed: int = 0


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What a bench consists of; a bench of one has its axis under the empty name."""

    config: Config
    axes: Mapping[str, Axis]
    stops: Stops
    groups: Groups
    recorder: Recorder
    black_box: BlackBox
    lease: Lease
    dead_man: DeadMan
    journal: Journal
    collector: IdleCollector
    counts: CommandCounts
    services: Services

    def named(self, names: tuple[str, ...]) -> list[Axis]:
        """Return the axes of these names; all without any. Raises Refusal for an unknown one."""
        for name in names:
            if name not in self.axes:
                raise Refusal(
                    Reason.INVALID,
                    "there is no axis of this name",
                    value=name,
                    limit=self._names or "none: a bench of one axis",
                    action="nothing was changed; name one of these, or leave `axis` out",
                )
        return [self.axes[name] for name in dict.fromkeys(names) or self.axes]

    def only_axis(self, names: tuple[str, ...]) -> Axis:
        """Return the one axis that a command is for. Raises Refusal where that is not one."""
        axes = self.named(names)
        if len(axes) != 1:
            raise Refusal(
                Reason.INVALID,
                "this command is for one axis",
                value=", ".join(names) or "none named",
                limit=self._names,
                action="nothing was changed; name one of these (--axis; in Python `axis`)",
            )
        return axes[0]

    @property
    def armed(self) -> bool:
        """Whether any axis is armed by us, or about to be."""
        return any(axis.hot for axis in self.axes.values())

    @property
    def _names(self) -> str:
        return ", ".join(self.axes)
