"""A supervisor with good measurements, to be spoilt one at a time."""

from collections.abc import Callable

from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Limits,
    Link,
    Measurements,
    Memory,
    Outcome,
    SelfTest,
    Supervisor,
)

PERIOD_US = 10_000
OHM_M = 760
HEAVY_MJ_PER_K = 3100
GOOD_LINK = Link()


class Rig:
    """A supervisor, its measurements and a clock.

    With `physical` on, current follows what is applied and each spring warms by the energy it gets.
    """

    def __init__(self, limits: Limits | None = None, *, physical: bool = True) -> None:
        self.supervisor = Supervisor(limits)
        self.m = Measurements(rtd_cC=[2700, 2700, 2680, 2680])
        self.physical = physical
        self.warms = [True, True]
        self.now_us = 0
        self.setpoint_mA = (0, 0)
        self.duty = (0, 0)
        self.send = True
        self.spoil: Callable[[Measurements], None] = lambda m: None
        self._uK = [27_000_000, 27_000_000]
        self._flicker = 0

    @property
    def state(self) -> BoardState:
        return self.supervisor.state

    @property
    def memory(self) -> Memory:
        return self.supervisor.memory

    def event(self, event: object) -> Outcome:
        return self.supervisor.event(event, self.now_us)  # type: ignore[arg-type]

    def step(self, samples: int = 1, period_us: int = PERIOD_US) -> None:
        """Take samples, each followed by a setpoint if the rig sends them."""
        for _ in range(samples):
            self.now_us += period_us
            if self.physical:
                self._move(period_us)
            self.spoil(self.m)
            self.supervisor.sample(self.m, self.now_us)
            if self.send:
                self.supervisor.setpoint(self.setpoint_mA, self.duty, 0, 100_000, self.now_us)

    def seconds(self, seconds: float) -> None:
        """Take as many samples as fit."""
        self.step(round(seconds * 1e6 / PERIOD_US))

    def until(self, state: BoardState, most_s: float = 60.0) -> float:
        """Step until the board is in `state`; return the seconds it took."""
        start_us = self.now_us
        while self.state is not state:
            assert self.now_us - start_us < most_s * 1e6, f"still {self.state.name}"
            self.step()
        return (self.now_us - start_us) * 1e-6

    def arm(self) -> "Rig":
        """Go through the self-test and both steps of arming."""
        self.event(SelfTest(True))
        self.step()
        assert self.event(ArmRequested(GOOD_LINK, 77)).accepted
        assert self.event(ArmConfirmed(GOOD_LINK, 77)).accepted
        return self

    def heat(self, x_mA: int = 4000, y_mA: int = 0, seconds: float = 1.0) -> "Rig":
        """Arm and heat for a while."""
        self.arm()
        self.setpoint_mA = (x_mA, y_mA)
        self.seconds(seconds)
        return self

    def _move(self, period_us: int) -> None:
        s, m = self.memory, self.m
        self._flicker ^= 1
        for k in (0, 1):
            m.applied_mA[k] = s.applied_mA[k]
            m.duty[k] = s.duty[k]
            m.i_mA[k] = s.applied_mA[k] if s.gate else 0
            m.v_mV[k] = m.i_mA[k] * OHM_M // 1000
            if self.warms[k]:
                self._uK[k] += m.i_mA[k] * m.v_mV[k] // 1000 * period_us // HEAVY_MJ_PER_K
                around_uK = m.rtd_cC[2] * 10_000
                loss = 20 + 550 * m.duty[k] // 255
                out_nJ = loss * (self._uK[k] - around_uK) // 1000 * period_us // 1000
                self._uK[k] -= out_nJ // HEAVY_MJ_PER_K
            m.rtd_cC[k] = self._uK[k] // 10_000 + self._flicker
