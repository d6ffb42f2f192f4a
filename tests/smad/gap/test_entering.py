"""What an effect must show to enter a model, since known-good runs and without them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from smad.gap import Settings
from smad.gap.fit.hypothesis import Hypothesis, acceptable, asked_gain

SETTINGS = Settings()


def candidate(*names: str, **numbers: float) -> Hypothesis:
    """A candidate that enters beyond doubt, but for the numbers given."""
    joint: Any = SimpleNamespace(names=names)
    judged: Any = None
    sure = Hypothesis(
        joint, judged, gain=1100.0, gain_se=100.0, touched=("a",),
        excess_before=2.0, regime_gain=150.0, cells=1000,
    )  # fmt: skip
    return replace(sure, **numbers)


def test_an_effect_that_shows_enters_tied_or_free() -> None:
    assert acceptable(candidate("x"), SETTINGS, tied=True)
    assert acceptable(candidate("x"), SETTINGS, tied=False)


def test_since_good_runs_a_gain_counts_by_the_cells_that_were_judged() -> None:
    assert asked_gain(candidate("x"), SETTINGS, tied=True) == 1000.0
    assert asked_gain(candidate("x", gain_se=600.0), SETTINGS, tied=True) == 1200.0
    assert asked_gain(candidate("x", gain_se=1.0), SETTINGS, tied=False) == 2.0
    assert asked_gain(candidate("x", gain_se=70.0), SETTINGS, tied=False) == 140.0


@pytest.mark.parametrize(
    "numbers",
    [{"gain": 990.0}, {"regime_gain": -1200.0}],
    ids=["no more than other laws bring", "lost in other regimes"],
)
@pytest.mark.parametrize("names", [("x",), ("x", "y")])
def test_an_effect_that_fails_one_test_stays_out(
    numbers: dict[str, float], names: tuple[str, ...]
) -> None:
    assert not acceptable(candidate(*names, **numbers), SETTINGS, tied=True)


@pytest.mark.parametrize("tied", [True, False])
def test_other_regimes_need_only_not_take_the_gain_back(tied: bool) -> None:
    assert acceptable(candidate("x", regime_gain=-1000.0), SETTINGS, tied=tied)
    assert not acceptable(candidate("x", regime_gain=-1200.0), SETTINGS, tied=tied)


def test_beside_tied_parameters_a_gain_needs_no_gap() -> None:
    assert acceptable(candidate("x", excess_before=0.3), SETTINGS, tied=True)
    assert not acceptable(candidate("x", excess_before=0.3), SETTINGS, tied=False)
