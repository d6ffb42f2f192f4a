"""When two runs count as runs of the same inputs."""

from __future__ import annotations

import numpy as np
import pytest

from smad.diagnosis.data.played import Played
from smad.diagnosis.data.rows import (
    Binned,
    bin_numbers,
    binned,
    edges_s,
    same_inputs,
    steps_in_gaps,
)
from smad.diagnosis.runs import GapRun
from tests.smad.diagnosis.heater_plant import HeaterPlant

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


def test_an_input_steps_at_the_same_times_with_the_other_sign() -> None:
    t_s, drive = 0.2 * np.arange(_BINS), 0.001 + _step()
    there, back = (edges_s(GapRun("run", t_s, {"drive": s * drive}, {})) for s in (1.0, -1.0))
    assert there.tolist() == back.tolist() == pytest.approx([16.0, 28.0])


PLANT = HeaterPlant()
READ = [c.name for c in PLANT.channels].index("temp_l_degC")


def course(lost: list[int], power: np.ndarray, *, gone: bool) -> GapRun:
    """Four rows of ten samples in which the left plate is read; lost samples gone, or marked."""
    n = np.arange(40)
    kept = np.isin(n, lost, invert=True)
    inputs = {s.name: np.zeros(40) for s in PLANT.inputs} | {"cmd_l_W": power}
    outputs = {"temp_l_degC": np.where(n < 15, 20.0, 50.0) + 0.01 * n}
    if not gone:
        return GapRun("r", 0.1 * n, inputs, outputs, valid=kept)
    left = [{name: c[kept] for name, c in columns.items()} for columns in (inputs, outputs)]
    return GapRun("r", 0.1 * n[kept], *left)


def counting(run: GapRun, *, partly: bool) -> list[bool]:
    valid: list[bool] = binned(run, 4, PLANT, -0.1, 1.0, partly=partly).valid[:, READ].tolist()
    return valid


@pytest.mark.parametrize("gone", [True, False])
def test_a_row_that_lacks_a_fifth_of_its_samples_counts_and_one_that_lacks_more_does_not(
    gone: bool,
) -> None:
    run = course([3, 13, 15, 22, 25, 28], np.zeros(40), gone=gone)
    assert counting(run, partly=True) == [True, True, False, True]
    assert counting(run, partly=False) == [False, False, False, True]


@pytest.mark.parametrize("gone", [True, False])
def test_a_row_is_compared_with_the_prediction_of_the_samples_that_it_has(gone: bool) -> None:
    # With the edge in the second row, the mean of all its samples is some K elsewhere.
    run = course([13, 14], np.zeros(40), gone=gone)
    played = Played.of(run, PLANT.inputs, -0.1, 1.0)
    measured = binned(run, 4, PLANT, -0.1, 1.0, partly=True).values[:, READ]
    predicted = played.means(run.outputs["temp_l_degC"][None], exact=True)[0]
    assert predicted == pytest.approx(measured, abs=1e-12)


@pytest.mark.parametrize("gone", [True, False])
def test_a_row_in_which_an_input_steps_while_samples_are_lost_does_not_count(gone: bool) -> None:
    step = np.where(np.arange(40) < 13, 0.0, 30.0)
    run = course([3, 13, 25], step, gone=gone)
    assert counting(run, partly=True) == [True, False, True, True]
    assert list(steps_in_gaps(run, PLANT.inputs)) == ["cmd_l_W"]


def test_an_input_that_changes_all_the_time_does_not_step_while_samples_are_lost() -> None:
    run = course([3, 13, 25], 30.0 + 30.0 * np.sin(np.arange(40) / 3.0), gone=False)
    assert not steps_in_gaps(run, PLANT.inputs)


def sampled(rate_hz: float, begin_s: float) -> GapRun:
    return GapRun("r", begin_s + np.arange(6000) / rate_hz, {}, {})


@pytest.mark.parametrize("rate_hz", [12.5, 62.5, 100.0])
def test_samples_of_unix_time_fall_into_the_rows_of_a_clock_that_began_at_0(rate_hz: float) -> None:
    # At 62.5 Hz every second row of 0.2 s begins in the middle of a sample's interval.
    near, far = sampled(rate_hz, 0.0), sampled(rate_hz, 1.7e9)
    rows = [bin_numbers(run, run.begins_s, 0.2) for run in (near, far)]
    assert np.array_equal(*rows)
    assert Played.of(near, (), near.begins_s).bins == Played.of(far, (), far.begins_s).bins
