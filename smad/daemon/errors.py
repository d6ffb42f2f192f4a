"""What the daemon raises on purpose: a refused command, and the ends it can come to."""

from __future__ import annotations

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
        return (_rebuild, (self.reason, self.cause, self.value, self.limit, self.action))


def _rebuild(reason: Reason, cause: str, value: Any, limit: Any, action: str) -> Refusal:
    return Refusal(reason, cause, value=value, limit=limit, action=action)


class TaskDied(DaemonError):
    """A task of the daemon ended with an error it should not have; the bench was disarmed."""

    exit_status = 70
