"""Arming a bench that was just started: its clock and ours need a moment to align."""

from __future__ import annotations

import time
from collections.abc import Callable

from smad.api import Reason
from smad.client.blocking import Client
from smad.client.errors import Refused

_POLL_S = 0.1
_NEEDS_A_PERSON = frozenset((Reason.STOPPED, Reason.FAULTED, Reason.DISAGREEMENT))


def arm_when_allowed(
    client: Client, timeout_s: float, waiting: Callable[[], None] = lambda: None
) -> None:
    """Arm as soon as the board allows it; call `waiting` before each further try.

    Raises Refused at once where a person must decide (a stop, a fault, parameters that disagree),
    else after `timeout_s`.
    """
    deadline_s = time.monotonic() + timeout_s
    while True:
        try:
            client.arm()
        except Refused as refused:
            if refused.reason in _NEEDS_A_PERSON or time.monotonic() > deadline_s:
                raise
            waiting()
            time.sleep(_POLL_S)
        else:
            return
