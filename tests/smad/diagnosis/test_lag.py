"""The lag of drives, sensors and smoothing."""

import numpy as np
import pytest

from smad.diagnosis.numerics.lag import lagged


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9999])
@pytest.mark.parametrize("n", [1, 300])
def test_a_lag_is_that_of_scipy_to_the_bit(keep: float, n: int) -> None:
    from scipy.signal import lfilter

    y = np.random.default_rng(1).normal(size=n)
    for way in (y, y[::-1]):
        theirs, _ = lfilter([1.0 - keep], [1.0, -keep], way, axis=0, zi=keep * way[:1])
        assert np.array_equal(lagged(way, keep), theirs)
