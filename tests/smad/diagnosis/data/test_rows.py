"""When two runs count as runs of the same inputs."""

from __future__ import annotations

import numpy as np

from smad.diagnosis.data.rows import Binned, same_inputs

_BINS = 400


def _played(current: np.ndarray) -> Binned:
    everywhere = np.ones(_BINS, dtype=bool)
    none = np.zeros((_BINS, 1))
    return Binned("run", none, everywhere[:, None], current[:, None], everywhere)


def _step() -> np.ndarray:
    current = np.zeros(_BINS)
    current[80:140] = 0.8
    return current


def test_an_edge_that_falls_elsewhere_in_its_bin_leaves_the_inputs_the_same() -> None:
    later = _step()
    later[80], later[139] = 0.65, 0.7
    assert same_inputs(_played(later), _played(_step()))


def test_a_supply_that_was_cut_off_for_a_sample_makes_other_inputs() -> None:
    tripped = _step()
    tripped[110] = 0.7
    assert not same_inputs(_played(tripped), _played(_step()))


def test_a_current_that_is_off_by_two_percent_in_many_bins_makes_other_inputs() -> None:
    assert not same_inputs(_played(1.05 * _step()), _played(_step()))
