"""The mean of good recordings, where some of them have no readings."""

import numpy as np
import pytest

from smad.diagnosis.paired.good import mean_of

BINS = 40
SLOW = np.linspace(0.0, 1.0, BINS)
"""What one day drifts by."""


@pytest.mark.parametrize("slopes", [(1.0, -1.0), (1.0, 0.0, -1.0)])
def test_a_mean_does_not_jump_where_a_repeat_misses_readings(slopes: tuple[float, ...]) -> None:
    values = np.array([20.0 + slope * SLOW for slope in slopes])[:, :, None]
    valid = np.ones(values.shape, dtype=bool)
    valid[0, 10:14] = False
    values[0, 10:14] = 0.0
    mean, count = mean_of(values, valid)
    np.testing.assert_allclose(mean[:, 0], 20.0)
    assert (count == len(slopes)).all()


def test_behind_the_end_of_a_repeat_a_mean_goes_on_with_those_that_are_left() -> None:
    values = np.array([20.0 + SLOW, 22.0 + SLOW])[:, :, None]
    valid = np.ones(values.shape, dtype=bool)
    valid[1, 30:] = False
    mean, count = mean_of(values, valid)
    np.testing.assert_allclose(mean[:, 0], 21.0 + SLOW)
    assert count[:, 0].tolist() == [2] * 30 + [1] * 10


def test_without_a_reading_there_is_no_mean() -> None:
    valid = np.ones((2, BINS, 1), dtype=bool)
    valid[:, 5] = False
    _, count = mean_of(np.ones((2, BINS, 1)), valid)
    assert np.flatnonzero(count[:, 0] == 0).tolist() == [5]
