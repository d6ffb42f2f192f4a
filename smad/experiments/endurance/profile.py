"""The cycle of an endurance run as a plan: between two displacements, or two temperatures."""

from dataclasses import dataclass
from typing import Literal

from smad.control.commands import Follow, Hold, HoldTemperature, Ramp, Trajectory
from smad.control.plan import Action, Do, Plan, UntilDone
from smad.experiments.errors import ExperimentError

NAME = "endurance"
"""How the run logs of its blocks are called, with the number of the first cycle."""
LATE_S = 60.0
CYCLES_A_COMMAND = 50
"""Four pieces each: well below the thousand that one command may have."""
MOST_CYCLES = 2000
"""Of a block: the controller's queue takes ten thousand pieces."""
SHARE = 0.75
"""A block takes so much of the longest time. Springs that rest before it need some of the rest."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """One cycle: up to `high`, dwell, down to `low`, dwell. In mm and mm/s, or °C and K/s.

    `spring` is the one whose temperature is cycled.
    """

    quantity: Literal["displacement", "temperature"] = "displacement"
    low: float = -5.0
    high: float = 5.0
    rate: float = 2.0
    dwell_s: float = 1.0
    spring: Literal["x", "y"] = "x"

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ExperimentError(
                "the profile has no amplitude",
                value=f"{self.low:g} to {self.high:g}",
                action="give the lower value first",
            )
        if not (self.rate > 0.0 and self.dwell_s >= 0.0):
            raise ExperimentError(
                "rate or dwell is not possible", value=f"{self.rate:g}, {self.dwell_s:g} s"
            )

    @property
    def period_s(self) -> float:
        """Duration of one cycle; of temperatures, where the springs can follow the rate."""
        return 2.0 * ((self.high - self.low) / self.rate + self.dwell_s)

    @property
    def reference(self) -> str:
        """Channel of the run log that has what was asked for."""
        return "reference_mm" if self.quantity == "displacement" else "reference_degC"

    def cycles_a_block(self, most: int, longest_s: float) -> int:
        """Return how many cycles one block may have, at most `most`.

        `longest_s` is how long one arming and one file of the run log may last.
        """
        return max(1, min(most, MOST_CYCLES, int(SHARE * longest_s / self.period_s)))

    def plan(self, first: int, count: int) -> Plan:
        """Return the plan of a block: `count` cycles from number `first` on."""
        name = f"{NAME}-{first:07d}"
        if self.quantity == "displacement":
            return Plan(name, (*self._moves(count), self._wait(count)))
        return Plan(name, tuple(action for _ in range(count) for action in self._heating()))

    def _moves(self, count: int) -> list[Action]:
        pieces: list[Trajectory] = []
        for _ in range(count):
            for goal_mm in (self.high, self.low):
                pieces.append(Ramp(displacement_mm=goal_mm, rate_mm_per_s=self.rate))
                if self.dwell_s:
                    pieces.append(Hold(duration_s=self.dwell_s))
        each = CYCLES_A_COMMAND * (4 if self.dwell_s else 2)
        return [
            Do(Follow(trajectories=tuple(pieces[begin : begin + each]), queue=begin > 0))
            for begin in range(0, len(pieces), each)
        ]

    def _heating(self) -> list[Action]:
        return [
            action
            for goal_degC in (self.high, self.low)
            for action in (
                Do(
                    HoldTemperature(
                        spring=self.spring,
                        temperature_degC=goal_degC,
                        rate_K_per_s=self.rate,
                        duration_s=max(self.dwell_s, 0.1),
                    )
                ),
                self._wait(1),
            )
        ]

    def _wait(self, count: int) -> UntilDone:
        return UntilDone(count * self.period_s + LATE_S)
