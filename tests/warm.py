"""Compile once what each worker of the tests would else compile: python -m tests.warm

The independent plant above all: it takes twenty seconds. And numba's own kernel, which takes a
minute and which a program uses where there is no library of C. Compiled code is kept beside its
source.
"""

from __future__ import annotations

import os
import subprocess
import sys

from evaluation.bank.recorder import record
from evaluation.plant.parameters import Bench
from tests.smad.simulators.systems import heater_run, pendulum_run


def warm() -> None:
    """Call what is compiled, numba's kernel in a process beside this one."""
    kernel = "from tests.sim_device.plant.test_bits import fingerprints; fingerprints()"
    numba = {**os.environ, "SMAD_KERNEL": "numba"}
    with subprocess.Popen([sys.executable, "-c", kernel], env=numba) as beside:
        _here()
    if beside.returncode:
        raise SystemExit(beside.returncode)


def _here() -> None:
    record(Bench(), (), "steps", 5, seconds=13.0)
    heater_run(1)
    pendulum_run(1)


if __name__ == "__main__":
    warm()
