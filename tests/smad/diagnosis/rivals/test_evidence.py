"""Rows of runs: what wanders is taken off, and how well the form of what has entered is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.rivals.evidence import (
    Evidence,
    Trial,
    form_sd_of,
    weights,
    with_drifts,
    without_drifts,
)

FLOOR, BINS, CHANNELS = 0.5, 600, 3


def test_the_form_of_a_change_is_known_to_the_share_of_it_that_is_left() -> None:
    rng = np.random.default_rng(7)
    change = np.abs(rng.normal(10.0, 3.0, (BINS, CHANNELS)))
    change[:, 2] = 0.0
    residual = FLOOR * rng.normal(size=change.shape)
    residual[:, 0] += 0.3 * change[:, 0] * rng.normal(size=BINS)
    valid = np.ones(change.shape, dtype=bool)
    # What is far off and does not count.
    residual[:50, 1], valid[:50, 1] = 40.0, False
    rows = RunRows.of(np.full(CHANNELS, FLOOR), valid)
    trial = Trial(played=cast(Any, SimpleNamespace()), target=residual, rows=rows)
    (known,) = form_sd_of(Evidence(trials=(trial,)), [np.zeros_like(residual)], [change])
    assert known[:, 0] == pytest.approx(0.3 * change[:, 0])
    assert known[:, 1] == pytest.approx(0.0, abs=0.06 * change[:, 1].max())
    assert not known[:, 2].any()


def test_rows_that_are_less_known_count_less() -> None:
    rows = RunRows.of(np.full(1, 3.0), np.ones((4, 1), dtype=bool))
    trial = Trial(played=cast(Any, SimpleNamespace()), target=np.full((4, 1), 10.0), rows=rows)
    unknown = np.array([[0.0], [0.0], [4.0], [4.0]])
    residual = Evidence(trials=(trial.with_added_sd(unknown),)).residual([np.zeros((4, 1))])
    assert residual == pytest.approx([10 / 3, 10 / 3, 2.0, 2.0])


@pytest.mark.parametrize("sizes", [0.0, 1.0, 2.0, 3.0])
def test_a_drift_of_several_times_the_usual_size_is_taken_off(sizes: float) -> None:
    day = 34.0 * np.linspace(0.0, 1.0, BINS)[None, :, None]
    noise = np.random.default_rng(3).normal(size=(BINS, 1))
    rows = RunRows.of(np.ones(1), np.ones((BINS, 1), dtype=bool), day)
    trial = Trial(played=cast(Any, SimpleNamespace()), target=noise + sizes * day[0], rows=rows)
    evidence = Evidence(trials=(trial,))
    residual = without_drifts(evidence, evidence.residual([np.zeros((BINS, 1))]))
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(np.sqrt(np.mean(noise**2)), rel=0.02)
    assert weights(evidence, residual) == pytest.approx(1.0 / (32.0 * np.ones(BINS)), rel=0.1)


def test_a_prediction_is_drawn_with_the_drift_that_is_taken_off_in_its_gap() -> None:
    day = np.linspace(0.0, 1.0, BINS)[None, :, None]
    drift = 20.0 * day[0]
    rows = RunRows.of(np.full(1, FLOOR), np.ones((BINS, 1), dtype=bool), 10.0 * day)
    predicted = np.sin(np.arange(BINS))[:, None]
    trials = [
        Trial(played=cast(Any, SimpleNamespace()), target=predicted + x, rows=r)
        for x, r in ((drift, rows), (0.0, RunRows.of(np.full(1, FLOOR), rows.valid)))
    ]
    evidence = Evidence(trials=tuple(trials))
    drawn, as_it_was = with_drifts(evidence, [predicted, predicted])
    assert drawn == pytest.approx(predicted + drift, abs=0.1 * FLOOR)
    assert (as_it_was == predicted).all()
    residual = without_drifts(evidence, evidence.residual([predicted, predicted]))
    assert evidence.residual([drawn, as_it_was]) == pytest.approx(residual, abs=0.01)


def folds_of(*recorded: int) -> Evidence:
    """Evidence of runs of which so many of 600 rows were recorded."""
    trials = []
    for bins in recorded:
        valid = np.zeros((BINS, CHANNELS), dtype=bool)
        valid[:bins] = True
        rows = RunRows.of(np.full(CHANNELS, FLOOR), valid)
        target = np.zeros(valid.shape)
        trials.append(Trial(played=cast(Any, SimpleNamespace()), target=target, rows=rows))
    return Evidence(trials=tuple(trials))


@pytest.mark.parametrize("recorded", [(600,), (24, 24), (600, 24, 0), (24, 0, 0, 0)])
def test_of_less_than_four_runs_what_was_recorded_is_divided_into_four_folds(
    recorded: tuple[int, ...],
) -> None:
    evidence = folds_of(*recorded)
    counted = evidence.fold[evidence.valid > 0.0]
    assert not evidence.by_runs
    assert np.bincount(counted).tolist() == 4 * [sum(recorded) * CHANNELS / 4]
    assert (evidence.fold[evidence.valid == 0.0] == -1).all()


def test_of_more_runs_each_that_has_a_row_is_a_fold() -> None:
    evidence = folds_of(600, 0, 600, 3, 24)
    counted = evidence.fold[evidence.valid > 0.0]
    assert evidence.by_runs
    assert np.bincount(counted).tolist() == [CHANNELS * n for n in (600, 600, 3, 24)]


def test_a_channel_that_no_run_has_is_not_counted() -> None:
    valid = np.ones((BINS, CHANNELS), dtype=bool)
    valid[:, 1] = False
    rows = RunRows.of(np.ones(CHANNELS), valid)
    trial = Trial(played=cast(Any, SimpleNamespace()), target=np.zeros((BINS, CHANNELS)), rows=rows)
    assert Evidence(trials=(trial,)).recorded == CHANNELS - 1
