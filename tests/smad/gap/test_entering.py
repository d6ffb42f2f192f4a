"""What an effect must show to enter a model, since known-good runs and without them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from smad.gap import Settings
from smad.gap.select import Candidate, acceptable, certainty

SETTINGS = Settings()


def candidate(*names: str, **numbers: float) -> Candidate:
    """A candidate that enters beyond doubt, but for the numbers given."""
    joint: Any = SimpleNamespace(names=names)
    judged: Any = None
    sure = Candidate(
        joint, judged, gain=500.0, gain_se=100.0, p_value=1e-6, touched=("a",),
        shrink_gain=0.5, excess_before=2.0, regime_gain=100.0,
    )  # fmt: skip
    return replace(sure, **numbers)


def test_an_effect_that_shows_enters_tied_or_free() -> None:
    assert acceptable(candidate("x"), SETTINGS, tied=True)
    assert acceptable(candidate("x"), SETTINGS, tied=False)


@pytest.mark.parametrize(
    ("numbers", "errors"),
    [({}, 3.0), ({"shrink_gain": 0.1}, 4.0), ({"excess_before": 0.3}, 4.0)],
    ids=["takes a part of the gap", "takes little of it", "no gap to take"],
)
def test_since_good_runs_a_gain_counts_by_what_it_takes_of_the_gap(
    numbers: dict[str, float], errors: float
) -> None:
    assert certainty(candidate("x", **numbers), SETTINGS, tied=True) == errors
    assert certainty(candidate("x", **numbers), SETTINGS, tied=False) == 1.0


@pytest.mark.parametrize(
    "numbers",
    [
        {"gain": 250.0},
        {"p_value": 0.02},
        {"regime_gain": -600.0},
        {"shrink_gain": 0.01},
        {"excess_before": 0.1},
    ],
    ids=["small gain", "chance", "lost in other regimes", "takes nothing", "no gap"],
)
def test_an_effect_that_fails_one_test_stays_out(numbers: dict[str, float]) -> None:
    assert not acceptable(candidate("x", **numbers), SETTINGS, tied=True)


def test_beside_tied_parameters_a_strong_gain_needs_no_gap() -> None:
    strong = {"gain": 700.0, "excess_before": 0.1, "shrink_gain": 0.0}
    assert acceptable(candidate("x", **strong), SETTINGS, tied=True)
    assert not acceptable(candidate("x", **strong), SETTINGS, tied=False)
    assert not acceptable(candidate("x", "y", **strong), SETTINGS, tied=True)


def test_a_strong_gain_must_take_its_part_of_a_gap_that_is_there() -> None:
    little = {"gain": 700.0, "excess_before": 0.8, "shrink_gain": 0.05}
    assert not acceptable(candidate("x", **little), SETTINGS, tied=True)
    assert acceptable(candidate("x", **{**little, "shrink_gain": 0.12}), SETTINGS, tied=True)


def test_a_further_cause_must_find_a_floor_left() -> None:
    small = {"excess_before": 0.8}
    assert acceptable(candidate("x", **small), SETTINGS, tied=True)
    assert not acceptable(candidate("x", "y", **small), SETTINGS, tied=True)
    assert acceptable(candidate("x", "y", excess_before=1.1), SETTINGS, tied=True)
    assert acceptable(candidate("x", "y", **small), SETTINGS, tied=False)
