"""Arm a bench as soon as its board allows it: the clocks agree, and the springs are cold."""

import time
from collections.abc import Callable

from smad.api import Reason
from smad.client.blocking import Client
from smad.client.errors import Refused
from smad.client.signals import ended_by_signals
from smad.progress import Say

_ARMED = "armed: the bench heats when you command it; smad disarm ends this"
_POLL_S = 0.1
_NEEDS_A_PERSON = frozenset(
    (Reason.STOPPED, Reason.FAULTED, Reason.DISAGREEMENT, Reason.NOT_IN_CONTROL)
)


def arm_and_tell(client: Client, tell: Say) -> None:
    """Arm for good, and say so; disarm where whoever asked does not come to know of it.

    That is: interrupted by ctrl-C or a signal, not answered, or `tell` raises. Raises what `arm`
    and `tell` do.
    """
    with ended_by_signals():
        try:
            client.arm()
            tell(_ARMED)
        except Refused:
            # Somebody else may have armed it.
            raise
        except BaseException:
            client.disarm_after_an_error()
            raise


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
