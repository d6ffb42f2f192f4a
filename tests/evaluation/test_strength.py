"""Strengths and the oracle: what a refit absorbs, what it leaves, and the exact law's share."""

from dataclasses import replace

import numpy as np
import pytest

from evaluation.bank import strength
from evaluation.bank.strength import Plan, Rig
from evaluation.plant.effects import Active
from evaluation.plant.parameters import another_bench, changed_parameters

PLAN = Plan(
    (
        ("steps", 11, "fit"),
        ("open_loop", 12, "fit"),
        ("sines", 13, "hold_out"),
    ),
    40.0,
)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return strength.rig(another_bench(np.random.default_rng(4)), PLAN)


def test_the_floor_is_noise_and_the_day_and_little_else(rig: Rig) -> None:
    floor = np.sqrt(rig.floor_squares)
    noise = np.array([2.2e-3, 2.2e-3, 2.2e-3, 2.2e-3, 0.028, 0.028, 3.9e-3, 2.1e-3])
    assert (floor > 0.9 * noise).all()
    assert (floor < 15 * noise).all()


def test_no_effect_leaves_no_gap(rig: Rig) -> None:
    gap, _ = rig.after_refit(rig.recorded(()))
    assert gap.worst < 0.05


def test_changed_parameters_are_eaten_by_the_refit(rig: Rig) -> None:
    elsewhere = changed_parameters(np.random.default_rng(1), rig.bench)
    runs = rig.recorded((), elsewhere)
    raw = strength.raw_gap(rig, runs)
    gap, _ = rig.after_refit(runs)
    assert raw.worst > 5.0
    assert gap.worst < 0.2 * raw.worst


def test_an_effect_is_scaled_to_its_strength(rig: Rig) -> None:
    found = strength.find(rig, Active("rtd_lag", 0.02), 3.0)
    assert found.reaches(3.0)
    again, _ = rig.after_refit(rig.recorded((found.active,)))
    assert again.worst == pytest.approx(found.gap.worst, rel=0.2)
    double = replace(found.active, magnitude=2 * found.active.magnitude)
    stronger, _ = rig.after_refit(rig.recorded((double,)))
    assert stronger.worst > 1.4 * found.gap.worst


def test_the_exact_law_takes_most_of_the_gap(rig: Rig) -> None:
    active = (Active("rtd_offset", 1.0),)
    runs = rig.recorded(active)
    gap, _ = rig.after_refit(runs)
    exact = strength.exact_law(rig, runs, active)
    assert gap.worst > 3.0
    assert exact.worst < 0.3 * gap.worst


def test_a_strength_out_of_reach_is_said_to_be_so(rig: Rig) -> None:
    found = strength.find(rig, Active("rtd_offset", 0.01), 1e4)
    assert not found.reaches(1e4)
    assert found.active.magnitude == pytest.approx(6.0)
