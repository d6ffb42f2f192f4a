"""`python -m campaign.faults.program FOLDER KIND [MS]`: a process that arms the bench.

It has the client as any program has it, with the lease that arming takes. Each step is one line on
its standard output.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence

from smad.client import Client
from smad.control.commands import DriveCurrent
from smad.control.plan import Do, Pause, Plan
from smad.errors import SmadError
from smad.experiments.replayer import InPlaceDriver

HEATING = "heating"
GAVE_UP = "gave up"
_FULL_A = 4.0
_RUN_S = 120.0
_TRIES = 3
_PATIENCE_S = 60.0


def main(arguments: Sequence[str]) -> None:
    """Be the program of this kind on the bench of a folder."""
    folder, kind, *more = arguments
    with Client(folder=folder, timeout_s=_PATIENCE_S) as client:
        _KINDS[kind](client, *more)


def _heats(client: Client) -> None:
    """Arms, heats, and is there until it is killed."""
    client.arm()
    client.current(DriveCurrent(i_x_A=_FULL_A))
    _say(HEATING)
    signal.pause()


def _dies_arming(client: Client, after_ms: str) -> None:
    """Is killed so long after it began to arm."""
    threading.Timer(float(after_ms) * 1e-3, os.kill, (os.getpid(), signal.SIGKILL)).start()
    client.arm()
    client.current(DriveCurrent(i_x_A=_FULL_A))
    signal.pause()


def _plays_on(client: Client) -> None:
    """Plays runs one after the other, and does not care that one was stopped."""
    driver = InPlaceDriver(client)
    for number in range(1, _TRIES + 1):
        plan = Plan(f"run-{number}", (Do(DriveCurrent(i_x_A=_FULL_A)), Pause(_RUN_S)))
        try:
            driver.run(plan)
            client.disarm()
        except SmadError as error:
            _say(f"{plan.name}: {error}")
    _say(GAVE_UP)


def _say(text: str) -> None:
    print(text, flush=True)


_KINDS: dict[str, Callable[..., None]] = {
    "heats": _heats,
    "dies_arming": _dies_arming,
    "plays_on": _plays_on,
}

if __name__ == "__main__":
    main(sys.argv[1:])
