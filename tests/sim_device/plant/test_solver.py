"""What the solver costs where transformations overlap: rounds are counted, not time."""

import numpy as np
import pytest

from bench.plant import OVERLAPPING, evaluations_per_substep
from sim_device.plant import load_parameters, simulate
from tests.sim_device.plant.cases import alternating


@pytest.mark.parametrize("name", OVERLAPPING)
@pytest.mark.parametrize("every", [1, 5])
def test_overlapping_transformations_cost_at_most_four_times_the_usual(name, every):
    usual = evaluations_per_substep(None, every)
    assert usual > 2 * 5  # one evaluation of each cell of both springs is the least
    assert evaluations_per_substep(name, every) <= 4 * usual


def test_evaluations_are_counted_from_the_start_of_a_run():
    out = simulate(load_parameters("A"), alternating(10.0), outputs=("kinetics_evaluations",))
    counted = out["kinetics_evaluations"]
    assert counted[0] == 0.0
    assert (np.diff(counted) >= 2 * 10).all()  # both springs in ten substeps of a sample
