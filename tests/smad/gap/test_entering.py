"""What an effect must show to enter a model, since known-good runs and without them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from smad.gap import Settings
from smad.gap.fit.candidate import Candidate, acceptable, asked_gain

SETTINGS = Settings()


def candidate(*names: str, **numbers: float) -> Candidate:
    """A candidate that enters beyond doubt, but for the numbers given."""
    joint: Any = SimpleNamespace(names=names)
    judged: Any = None
    sure = Candidate(
        joint, judged, gain=1100.0, gain_se=100.0, p_value=1e-6, touched=("a",),
        shrink_gain=0.5, excess_before=2.0, regime_gain=150.0, cells=1000,
    )  # fmt: skip
    return replace(sure, **numbers)


def test_an_effect_that_shows_enters_tied_or_free() -> None:
    assert acceptable(candidate("x"), SETTINGS, tied=True)
    assert acceptable(candidate("x"), SETTINGS, tied=False)


@pytest.mark.parametrize(
    ("numbers", "asked"),
    [({}, 300.0), ({"shrink_gain": 0.4}, 1000.0), ({"excess_before": 0.9}, 1000.0),
     ({"shrink_gain": 0.4, "gain_se": 600.0}, 1200.0)],
    ids=["takes most of a gap", "takes less of it", "little gap to take", "uncertain"],
)  # fmt: skip
def test_since_good_runs_a_gain_counts_by_the_cells_that_were_judged(
    numbers: dict[str, float], asked: float
) -> None:
    assert asked_gain(candidate("x", **numbers), SETTINGS, tied=True) == pytest.approx(asked)
    assert asked_gain(candidate("x", gain_se=1.0), SETTINGS, tied=False) == 2.0
    assert asked_gain(candidate("x", gain_se=70.0), SETTINGS, tied=False) == 70.0


@pytest.mark.parametrize(
    "numbers",
    [
        {"gain": 250.0},
        {"p_value": 0.02},
        {"regime_gain": -1200.0},
        {"regime_gain": 100.0},
        {"shrink_gain": 0.4, "gain": 990.0},
    ],
    ids=[
        "small gain",
        "chance",
        "lost in other regimes",
        "no help in other regimes",
        "no more than other laws bring",
    ],
)
def test_an_effect_that_fails_one_test_stays_out(numbers: dict[str, float]) -> None:
    assert not acceptable(candidate("x", **numbers), SETTINGS, tied=True)


def test_without_good_runs_other_regimes_need_only_not_take_the_gain_back() -> None:
    assert acceptable(candidate("x", regime_gain=-1000.0), SETTINGS, tied=False)
    assert not acceptable(candidate("x", regime_gain=-1200.0), SETTINGS, tied=False)


@pytest.mark.parametrize("numbers", [{"shrink_gain": 0.05}, {"excess_before": 0.3}])
def test_beside_tied_parameters_a_gain_needs_no_gap(numbers: dict[str, float]) -> None:
    assert acceptable(candidate("x", **numbers), SETTINGS, tied=True)
    assert not acceptable(candidate("x", **numbers), SETTINGS, tied=False)


def test_a_large_gain_may_come_from_one_regime_but_not_against_the_others() -> None:
    one_regime = {"gain": 3000.0, "regime_gain": 100.0}
    assert acceptable(candidate("x", **one_regime), SETTINGS, tied=True)
    assert not acceptable(candidate("x", **one_regime | {"gain": 1500.0}), SETTINGS, tied=True)
    assert not acceptable(candidate("x", **one_regime | {"regime_gain": -1.0}), SETTINGS, tied=True)


def test_a_further_cause_must_be_more_certain() -> None:
    uncertain = {"gain": 1100.0, "gain_se": 500.0, "shrink_gain": 0.2}
    assert acceptable(candidate("x", **uncertain), SETTINGS, tied=True)
    assert not acceptable(candidate("x", "y", **uncertain), SETTINGS, tied=True)
    assert acceptable(candidate("x", "y", **uncertain | {"gain": 1300.0}), SETTINGS, tied=True)
