"""What a client raises: the daemon is not there, does not answer, or refuses."""

from typing import Any

from smad.api import ErrorData, Reason
from smad.errors import CommandError, DaemonError


class NoDaemon(DaemonError):
    """No daemon is running where the client looked."""


class NoAnswer(DaemonError):
    """The daemon did not answer in time. Whether the command was carried out is not known."""


class Stopped(DaemonError):
    """What was waited for will not come: a stop, or another client, has ended it."""


class Refused(CommandError):
    """The daemon refused a command; nothing was changed. `reason` is for a program to decide by."""

    def __init__(
        self,
        cause: str,
        *,
        reason: Reason = Reason.INVALID,
        value: Any = None,
        limit: Any = None,
        action: str = "",
    ) -> None:
        super().__init__(cause, value=value, limit=limit, action=action)
        self.reason = reason


class NotInControl(Refused):
    """Another client has exclusive control."""


class NotReady(Refused):
    """The bench is not in the state that the command needs: connected, armed, without a fault."""


class BoardRefused(Refused):
    """The board itself refused, or did not answer."""


_KINDS: dict[Reason, type[Refused]] = {
    Reason.NOT_IN_CONTROL: NotInControl,
    Reason.NOT_CONNECTED: NotReady,
    Reason.NOT_ARMED: NotReady,
    Reason.ARMED: NotReady,
    Reason.FAULTED: NotReady,
    Reason.STOPPED: NotReady,
    Reason.DISAGREEMENT: NotReady,
    Reason.BOARD_REFUSED: BoardRefused,
    Reason.NO_REPLY: BoardRefused,
}


def refused(data: ErrorData) -> Refused:
    """Return the error that an error reply stands for."""
    kind = _KINDS.get(data.reason, Refused)
    return kind(
        data.cause, reason=data.reason, value=data.value, limit=data.limit, action=data.action
    )
