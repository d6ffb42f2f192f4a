"""The library of C, numba and plain Python give the same bits."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.replay import OUTPUTS

CASES = (
    {},
    {"variant": "printed"},
    {"cooling": "air"},
    {"fixture": "blocked"},
    {"effects": {entry.name: {} for entry in EFFECTS if entry.name != "water_warming"}},
)


def fingerprints():
    """A hash of every output of a short run that heats, pumps and detwins, for each case."""
    t = np.arange(250) * 0.02
    i_A = np.column_stack([np.where((t > 0) & (t < 3.5), 4.0, 0.0), np.where(t > 4.0, 3.0, 0.0)])
    duty = np.column_stack([np.where(t > 3.5, 0.9, 0.0), 0 * t])
    inputs = Inputs(t, i_A, duty)
    found = []
    for options in CASES:
        out = simulate(load_parameters("B"), inputs, dt_s=2e-2, **options)
        found.append(hashlib.sha256(b"".join(out[name].tobytes() for name in OUTPUTS)).hexdigest())
    return found


@pytest.mark.parametrize("way", [{"NUMBA_DISABLE_JIT": "1"}, {"SMAD_KERNEL": "numba"}], ids=str)
def test_every_way_to_run_the_kernel_gives_the_same_bits(way):
    code = "from tests.sim_device.plant.test_bits import fingerprints; print(*fingerprints())"
    other = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **way},
        capture_output=True,
        text=True,
        check=True,
    )
    assert other.stdout.split() == fingerprints()
