"""Intervals of what is estimated from a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from smad.arrays import Index
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import bootstrap

VALUES = np.random.default_rng(3).normal(5.0, 1.0, 200)


def test_the_interval_of_a_mean_is_about_its_standard_error_on_either_side() -> None:
    value, low, high = bootstrap(lambda chosen: [VALUES[chosen].mean()], len(VALUES), seed=1)
    assert value[0] == pytest.approx(VALUES.mean())
    assert (high[0] - low[0]) / 2 == pytest.approx(1.96 / np.sqrt(len(VALUES)), rel=0.5)


def test_what_no_resample_can_be_fitted_to_is_refused() -> None:
    def fit(chosen: Index) -> Sequence[float]:
        if len(np.unique(chosen)) < len(VALUES):
            raise ValueError("too few")
        return [1.0]

    with pytest.raises(ExperimentError, match="no resample of the samples can be fitted"):
        bootstrap(fit, len(VALUES), seed=1)
