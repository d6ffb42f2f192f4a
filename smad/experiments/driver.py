"""Who carries a plan out: virtual time, a running daemon, or logs that were made before.

An experiment sees only `Driver`, so it cannot tell them apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from smad.control.plan import Cooling, Fixture, Plan
from smad.experiments.recording import Recording

PARTS: Mapping[str, str] = {
    "displacement_mm": "the encoder",
    "force_N": "the force sensor",
    "rtd_x_degC": "the temperature sensor of spring X",
    "rtd_y_degC": "the temperature sensor of spring Y",
    "v_x_V": "the voltage sense of spring X",
    "i_meas_x_A": "the current sensor of spring X",
    "stage": "the stretching stage",
    "drain": "the drain valves",
}
"""What an experiment may need: channels of the run log, and actuators, with their names."""


def log_name(plan: Plan) -> str:
    """The name of a plan in run logs and their files, which a slash would not fit."""
    return plan.name.replace("/", "_")


def log_path(folder: Path, plan: Plan) -> Path:
    """The run log of a plan that a simulated bench carries out."""
    return folder / f"{log_name(plan)}.mcap"


@dataclass(frozen=True, order=True)
class Mounting:
    """How the springs are mounted."""

    fixture: Fixture = "antagonistic"
    cooling: Cooling = "water"

    def __str__(self) -> str:
        return f"{self.fixture}, in {self.cooling}"


class Driver(Protocol):
    """Carries out plans, each as one recorded run."""

    def parts(self) -> frozenset[str]:
        """Which of `PARTS` this bench has."""

    def mounting(self) -> Mounting | None:
        """How the springs are mounted; None when any mounting can be had."""

    def run(self, plan: Plan) -> Recording:
        """Carry out the plan from rest and return what was recorded.

        Raises ExperimentError (or the error of a refused command) when it did not come to its end.
        """
