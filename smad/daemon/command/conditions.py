"""What must hold before a command is carried out; a refusal says why not and what to do."""

from __future__ import annotations

import asyncio
from collections.abc import Collection

from firmware_protocol.enums import BoardState, Capability
from firmware_protocol.events import HostState
from smad.api import Reason
from smad.daemon.axis import Axis
from smad.daemon.errors import Refusal
from smad.daemon.link.tighter import require_own, require_tighter
from smad.daemon.link.watch import disagreement

_PARAMETER_POLLS = 100
_PARAMETER_POLL_S = 0.02


class Conditions:
    """Conditions on the board of an axis and what is known of it. `names`: of all axes."""

    def __init__(self, axis: Axis, names: Collection[str]) -> None:
        self._names = names
        self._config = axis.config
        self._axis = axis
        self._watch = axis.watch
        self._host_stop = axis.host_stop

    def require_connected(self) -> None:
        """Raise Refusal unless there is a board, and one that takes requests."""
        if not self._axis.connected:
            raise not_connected(
                "the board is not connected",
                "plug it in; the daemon reconnects by itself (smad status)",
            )
        if self._watch.incompatible is not None:
            raise Refusal(
                Reason.DISAGREEMENT,
                "board and smad disagree, so the board can only be watched",
                value=disagreement(self._watch.incompatible),
                action="update the older of the two",
            )

    def require_disarmed(self) -> None:
        """Raise Refusal while the board is armed, or may be."""
        if self._axis.hot:
            raise Refusal(Reason.ARMED, "the bench is armed", action="disarm first (smad disarm)")

    async def parameters_read(self) -> None:
        """Wait for the parameters: right after a connection they are on their way."""
        for _ in range(_PARAMETER_POLLS):
            if self._watch.parameters.agree is not None or not self._watch.reading:
                return
            await asyncio.sleep(_PARAMETER_POLL_S)

    def require_armable(self) -> None:
        """Raise Refusal unless the board can be asked to arm."""
        self.require_connected()
        self.require_not_faulted()
        self.require_disarmed()
        agree = self._watch.parameters.agree
        if agree is None:
            raise Refusal(
                Reason.BUSY,
                "the board's parameters are still being read",
                action="try again in a second",
            )
        if not agree:
            raise Refusal(
                Reason.DISAGREEMENT,
                "the board's parameters are not those that were read from it",
                action="unplug it and plug it in again, so that they are read anew",
            )
        require_own(self._axis.name, self._names, self._watch.parameters)
        require_tighter(self._config, self._watch.parameters)

    def require_not_faulted(self) -> None:
        """Raise Refusal while a fault of board or host is latched."""
        by_host = self._host_stop.fault
        if by_host is not None:
            raise Refusal(
                Reason.FAULTED,
                "a limit of the host stopped the bench",
                value=by_host.in_words(),
                action="smad faults explain says what to do; then smad clear",
            )
        if self._axis.session.state is not HostState.FAULTED:
            return
        fault = self._watch.fault
        stopped = self._watch.mode is BoardState.ESTOP
        raise Refusal(
            Reason.FAULTED,
            f"the board is in {'ESTOP' if stopped else 'FAULT'}",
            value=None if fault is None else fault.in_words(),
            action="power-cycle the board: nothing else ends ESTOP"
            if stopped
            else "smad faults explain says what to do; then smad clear",
        )

    def require_stage(self) -> None:
        """Raise Refusal unless the board moves a stretching stage."""
        # Displacement is the stage's doing once one is used, and not limited any more.
        ident = self._watch.ident
        if ident is None or not ident.capabilities & Capability.STAGE:
            raise Refusal(
                Reason.INVALID,
                "this board moves no stretching stage",
                limit="a board with the capability `stage`",
                action="nothing was changed; smad status --json lists what the board has",
            )

    def require_armed(self) -> None:
        """Raise Refusal unless the board is armed, by us."""
        self.require_connected()
        self.require_not_faulted()
        if self._axis.session.state is not HostState.RUNNING:
            raise Refusal(
                Reason.NOT_ARMED, "the bench is not armed", action="arm it first (smad arm)"
            )


def not_connected(cause: str, action: str) -> Refusal:
    """Return the refusal of a command that needs a board."""
    return Refusal(Reason.NOT_CONNECTED, cause, action=action)
