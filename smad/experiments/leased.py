"""A driver whose bench is armed only under a lease, for the length of each plan."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from smad.client import BoardRefused
from smad.experiments.driver import Mounting
from smad.experiments.live import LiveDriver
from smad.experiments.recording import Recording
from smad.progress import Say

if TYPE_CHECKING:
    from smad.client import Client
    from smad.control.plan import Plan

_COOLING_S = 600.0
_POLL_S = 0.1


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
        deadline_s = self._clock_s() + _COOLING_S
        for attempt in itertools.count(1):
            try:
                self.client.arm()
            except BoardRefused:
                # The token of an arming lasts for two seconds of board time: a busy computer, or a
                # bench that runs faster than the wall clock, may let them pass.
                if attempt == 1:
                    continue
                # After our own disarm the springs are still cooling; else it is worth telling.
                if not self._disarmed or self._clock_s() > deadline_s:
                    raise
                self._progress(f"{plan.name}: waiting until the springs are cold enough to arm")
                self._sleep(_POLL_S)
            else:
                return
