"""A driver whose bench is armed only under a lease, for the length of each plan."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from smad.client.arming import arm_when_allowed
from smad.experiments.driver import Mounting
from smad.experiments.live import LiveDriver
from smad.experiments.recording import Recording
from smad.progress import Say

if TYPE_CHECKING:
    from smad.client import Client
    from smad.control.plan import Plan

_COOLING_S = 600.0
_TOKEN_S = 0.2
"""Enough for a second try."""


class LeasedDriver:
    """Runs the plans of `driver` under exclusive control, and disarms after each.

    Between two runs the program may compute for longer than a lease lasts, so the bench is not
    armed then. A program that is killed in a run is silent, and the daemon disarms after `lease_s`.
    `sleep` and `clock_s` are those of the wall.
    """

    def __init__(
        self,
        client: Client,
        driver: LiveDriver,
        *,
        lease_s: float,
        progress: Say,
        who: str = "smad run",
        sleep: Callable[[float], None] = time.sleep,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.client = client
        self._driver = driver
        self._lease_s = lease_s
        self._progress = progress
        self._who = who
        self._sleep = sleep
        self._clock_s = clock_s
        self._disarmed = False

    @property
    def log(self) -> Path | None:
        """Where the last run was recorded, also one that ended early."""
        return self._driver.log

    def parts(self) -> frozenset[str]:
        """Which parts the bench has."""
        return self._driver.parts()

    def mounting(self) -> Mounting | None:
        """How its springs are mounted."""
        return self._driver.mounting()

    def run(self, plan: Plan) -> Recording:
        """Carry out a plan. Raises NotInControl while somebody else has control."""
        with self.client.in_control(self._who, self._lease_s):
            try:
                self._arm(plan)
                return self._driver.run(plan)
            finally:
                self.client.disarm()
                self._disarmed = True

    def _arm(self, plan: Plan) -> None:
        if self.client.motion().armed:
            return
        # After our own disarm the springs are still cooling; before the first run only an arming
        # token may have expired, on a busy computer.
        timeout_s = _COOLING_S if self._disarmed else _TOKEN_S
        arm_when_allowed(
            self.client,
            timeout_s,
            lambda: self._say_waiting(plan),
            sleep=self._sleep,
            clock_s=self._clock_s,
        )

    def _say_waiting(self, plan: Plan) -> None:
        if self._disarmed:
            self._progress(f"{plan.name}: waiting until the springs are cold enough to arm")


def leased_driver(
    client: Client, who: str, lease_s: float, say: Say, **mounted: Any
) -> LeasedDriver:
    """What carries plans out on the bench of a client, armed for each under a lease of `who`.

    `mounted`: fixture and cooling, as `LiveDriver` takes them.
    """
    live = LiveDriver(client, progress=say, **mounted)
    return LeasedDriver(client, live, lease_s=lease_s, progress=say, who=who)
