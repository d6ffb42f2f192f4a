"""Compile once what each worker of the tests would else compile: python -m tests.warm

The independent plant above all: it takes twenty seconds. Compiled code is kept beside its source.
"""

from __future__ import annotations

from evaluation.bank.recorder import record
from evaluation.plant.parameters import Bench
from tests.smad.simulators.systems import heater_run, pendulum_run


def warm() -> None:
    """Call what is compiled."""
    record(Bench(), (), "steps", 5, seconds=13.0)
    heater_run(1)
    pendulum_run(1)


if __name__ == "__main__":
    warm()
