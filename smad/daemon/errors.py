"""What the daemon raises on purpose: a refused command, and the ends it can come to."""

from collections.abc import Sequence
from typing import Any

from smad.api import Reason
from smad.errors import CommandError, DaemonError


class Refusal(CommandError):
    """A command was refused for `reason`; nothing was changed. Becomes an error reply."""

    def __init__(
        self,
        reason: Reason,
        cause: str,
        *,
        value: Any = None,
        limit: Any = None,
        action: str = "",
    ) -> None:
        super().__init__(cause, value=value, limit=limit, action=action)
        self.reason = reason

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, self.cause), self.__dict__


def raise_together(refusals: Sequence[Refusal]) -> None:
    """Raise the first refusal, if there is one, with the causes of all; what to do is the first's.

    For what is done to axes one by one: the reply names each that it was refused for.
    """
    if refusals:
        refusals[0].cause = "; ".join(refusal.cause for refusal in refusals)
        raise refusals[0]


class TaskDied(DaemonError):
    """A task of the daemon ended with an error it should not have; the bench was disarmed."""

    exit_status = 70
