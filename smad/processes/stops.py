"""Stops of the bench that a program and a command that it begins both know of.

The program hands over the generation of the last stop that it knows of, in the environment. The
command hands back, over a descriptor, the one that it knows of in the end: its own stops are among
those. Any other is somebody else's, also one that came while the command began or ended.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from smad.client import Client

_KNOWN, _REPORT = "SMAD_KNOWN_STOPS", "SMAD_REPORT_STOPS"


@dataclass
class KnownStops:
    """What one command knows of stops: the generation that its parent knew of, and its clients."""

    inherited: int | None = None
    clients: list[Client] = field(default_factory=list)

    @property
    def latest(self) -> int | None:
        """The generation of the last stop that it knows of."""
        known = (client.known for client in self.clients)
        return max((k for k in known if k is not None), default=self.inherited)


def knowing(known: int | None) -> dict[str, str]:
    """The environment of a command that knows of the stops up to a generation, and of no other."""
    return {_KNOWN: "" if known is None else str(known)}


class HandedOver:
    """The stops that a program hands over to one command that it begins, and gets back from it."""

    def __init__(self, known: int | None) -> None:
        self._known = known
        read, self.descriptor = os.pipe()
        """`descriptor` is for the command to inherit."""
        self._returned = os.fdopen(read)

    @property
    def environment(self) -> dict[str, str]:
        """What the command has to find in its environment."""
        return {**knowing(self._known), _REPORT: str(self.descriptor)}

    def close_descriptor(self) -> None:
        """Once the command has inherited it, or cannot be begun: what it writes then has an end."""
        os.close(self.descriptor)

    def returned(self) -> int | None:
        """Return the last stop that a command knew of that has ended; where it says nothing, that
        which it was begun with."""
        if not self._returned.closed:
            with self._returned as file:
                text = file.read()
            self._known = int(text) if text.isdigit() else self._known
        return self._known


def taken_over(environment: MutableMapping[str, str]) -> tuple[int | None, int | None]:
    """Return the last stop that whoever began this command knew of, and the descriptor for the last
    one that it knows of itself; both are taken out of its environment, None where they are not
    there."""
    known, report = environment.pop(_KNOWN, ""), environment.pop(_REPORT, "")
    descriptor = int(report) if report else None
    if descriptor is not None:
        # Whoever began this command reads until the last process that has it ends.
        os.set_inheritable(descriptor, False)
    return int(known) if known else None, descriptor


def hand_back(descriptor: int | None, known: int | None) -> None:
    """Tell whoever began this command which stop it knows of last."""
    if descriptor is not None:
        with open(descriptor, "w") as file:
            file.write("" if known is None else str(known))
