"""Samples that a time lacks: how many are surely lost, and where they were."""

from __future__ import annotations

import numpy as np
import pytest

from smad.diagnosis.data.columns import filled, lost_share, with_lost
from smad.diagnosis.runs import GapRun

T_S = 0.01 * np.arange(3000)


def ramp(t_s: np.ndarray) -> GapRun:
    return GapRun("ramp", t_s, {"u": t_s.copy()}, {"y": 2.0 * t_s})


def test_the_share_of_lost_samples_is_that_of_those_that_are_gone() -> None:
    kept = np.random.default_rng(0).random(len(T_S)) > 0.01
    assert lost_share(T_S[kept]) == pytest.approx(1.0 - np.mean(kept), abs=1e-3)
    assert lost_share(T_S) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.4])
def test_stamps_that_jitter_are_no_lost_samples(share: float) -> None:
    t_s = T_S + 0.01 * np.random.default_rng(0).uniform(-share, share, len(T_S))
    assert (np.diff(t_s) > 0.015).any()
    assert lost_share(t_s) == 0.0
    run = ramp(t_s)
    assert with_lost(run) is run


def test_a_lost_sample_comes_back_without_a_reading_and_between_its_neighbours() -> None:
    kept = np.isin(np.arange(len(T_S)), [5, 100, 101], invert=True)
    run = filled(with_lost(ramp(T_S[kept])))
    assert run.t_s == pytest.approx(T_S, abs=1e-12)
    assert run.inputs["u"] == pytest.approx(T_S, abs=1e-12)
    assert np.flatnonzero(~run.good).tolist() == [5, 100, 101]
    assert with_lost(run) is run
