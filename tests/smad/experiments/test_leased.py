"""A bench that is never armed without somebody who can be missed: on a client that only notes."""

import contextlib
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from smad.api import Reason
from smad.client import BoardRefused, Refused
from smad.experiments.live import LiveDriver

PLAN: Any = SimpleNamespace(name="a plan")


class Noting:
    """A client that runs plans as well; `refusals` is how often the board refuses to arm."""

    def __init__(self, refusals: int = 0) -> None:
        self.done: list[str] = []
        self.refusals = refusals
        self.armed = False
        self.breaks = False
        self.time_s = 0.0

    def sleep(self, seconds: float) -> None:
        self.time_s += seconds

    @contextlib.contextmanager
    def in_control(self, name: str, lease_s: float) -> Iterator[None]:
        self.done.append(f"{name} for {lease_s:g} s")
        yield
        self.done.append("released")

    def motion(self) -> Any:
        return SimpleNamespace(armed=self.armed)

    def arm(self) -> None:
        if self.refusals:
            self.refusals -= 1
            raise BoardRefused("the springs are not cold enough")
        self.armed = True
        self.done.append("armed")

    def disarm(self) -> None:
        self.armed = False
        self.done.append("disarmed")

    def run(self, plan: Any) -> str:
        assert self.armed
        self.done.append("ran")
        if self.breaks:
            raise ValueError("broken")
        return "a recording"


class Leased(LiveDriver):
    """A driver whose runs are those of the bench that only notes."""

    def _run(self, plan: Any) -> Any:
        bench: Any = self.client
        return bench.run(plan)


def leased(bench: Any) -> LiveDriver:
    return Leased(
        bench,
        lease_s=3.0,
        progress=bench.done.append,
        sleep=bench.sleep,
        clock_s=lambda: bench.time_s,
    )


def test_each_run_is_under_control_and_ends_disarmed() -> None:
    bench = Noting()
    driver = leased(bench)
    assert driver.run(PLAN) == "a recording"
    once = ["smad run for 3 s", "armed", "ran", "disarmed", "released"]
    assert bench.done == once
    driver.run(PLAN)
    assert bench.done == once * 2


def test_a_run_that_breaks_is_disarmed_too() -> None:
    bench = Noting()
    bench.breaks = True
    with pytest.raises(ValueError, match="broken"):
        leased(bench).run(PLAN)
    assert bench.done[-1] == "disarmed"


def test_between_two_runs_it_waits_for_the_springs_and_before_the_first_it_does_not() -> None:
    bench = Noting(refusals=100)
    driver = leased(bench)
    with pytest.raises(BoardRefused):
        driver.run(PLAN)
    assert bench.time_s < 1.0
    bench.refusals = 3
    assert driver.run(PLAN) == "a recording"
    assert sum("waiting until the springs are cold" in line for line in bench.done) == 3


def test_an_arming_whose_token_came_too_late_is_asked_for_once_more() -> None:
    bench = Noting(refusals=1)
    assert leased(bench).run(PLAN) == "a recording"
    assert not any("waiting" in line for line in bench.done)


def test_an_arming_that_a_person_must_decide_is_not_asked_for_again() -> None:
    bench = Noting()
    asked: list[int] = []

    def stopped() -> None:
        asked.append(1)
        raise Refused("a stop came in the meantime", reason=Reason.STOPPED)

    bench.arm = stopped  # type: ignore[method-assign]
    with pytest.raises(Refused):
        leased(bench).run(PLAN)
    assert len(asked) == 1
