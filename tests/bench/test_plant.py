"""The figures of the plant: each is measured, and set against something in the same run."""

import math

from bench.plant import (
    advance_rows,
    kernel_row,
    legs,
    parallel_rows,
    plain_row,
    solver_rows,
    table,
    tracking,
)


def test_every_figure_is_measured_and_positive():
    inputs = tracking(3.0)
    found = [
        kernel_row(inputs),
        *advance_rows(),
        *solver_rows(legs(8.0), "short"),
        plain_row(),
        *parallel_rows(inputs, 20),
    ]
    for row in found:
        assert math.isfinite(row.value)
        assert row.value > 0
        assert row.ratio is None or row.ratio > 0
        assert row.name in table(found)
    ratios = {row.against: row.ratio for row in found if row.ratio is not None}
    assert set(ratios) == {"real time", "LSODA", "compiled", "one thread"}


def test_the_recorded_run_follows_the_sine_that_it_was_asked_to():
    inputs = tracking(14.0)
    assert inputs.i_A.max() <= 4.0
    assert (inputs.i_A.min(axis=1) == 0.0).all()
    assert inputs.i_A[:, 0].max() > 1.0
    assert inputs.i_A[:, 1].max() > 1.0
