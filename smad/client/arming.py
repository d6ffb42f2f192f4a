"""Arm a bench as soon as its board allows it: the clocks agree, and the springs are cold."""

import time
from collections.abc import Callable

from smad.api import Reason
from smad.client.blocking import Client
from smad.client.errors import Refused

_POLL_S = 0.1
_NEEDS_A_PERSON = frozenset(
    (Reason.STOPPED, Reason.FAULTED, Reason.DISAGREEMENT, Reason.NOT_IN_CONTROL)
)


def arm_when_allowed(
    client: Client,
    timeout_s: float,
    waiting: Callable[[], None] = lambda: None,
    *,
    sleep: Callable[[float], None] = time.sleep,
    clock_s: Callable[[], float] = time.monotonic,
) -> None:
    """Arm as soon as the board allows it; call `waiting` before each further try.

    Raises Refused at once where a person must decide (a stop, a fault, parameters that disagree,
    another client in control), else after `timeout_s`.
    """
    deadline_s = clock_s() + timeout_s
    while True:
        try:
            client.arm()
        except Refused as refused:
            if refused.reason in _NEEDS_A_PERSON or clock_s() >= deadline_s:
                raise
            waiting()
            sleep(_POLL_S)
        else:
            return
