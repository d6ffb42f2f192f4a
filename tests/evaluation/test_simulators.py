"""Simulators of others, tried on simulated benches: the same pendulum, ratings and findings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluation.simulators.plants import PLANTS, SAMPLES, RatedPlant
from evaluation.simulators.rated import Case, cases, shares
from evaluation.simulators.side_by_side import FRICTION_N_M, lines_of, made_run, side_by_side
from smad.simulators.bind import bind


def test_a_run_of_the_pendulum_repeats_with_its_seed_and_shows_its_friction() -> None:
    assert all(
        np.array_equal(a, b)
        for a, b in zip(made_run(1).values(), made_run(1).values(), strict=True)
    )
    rubbed, free = (made_run(1, friction=f)["angle_rad"] for f in (FRICTION_N_M, 0.0))
    assert np.std(rubbed) < np.std(free)


def test_the_function_places_the_hidden_friction_at_the_torque(tmp_path: Path) -> None:
    (row,) = side_by_side(tmp_path, ("function",))
    assert row.place == "input_torque_N_m"
    assert row.name == "friction_N_m"
    assert abs(row.friction - FRICTION_N_M) < 0.3 * FRICTION_N_M
    assert row.lines < 20


def test_a_cause_that_is_rated_not_to_be_seen_is_simulated_at_its_most() -> None:
    heater = PLANTS["heater"]
    (hidden,) = cases(heater, 1, 0, lambda text: None)
    played = {**heater.inputs(0), "temperature_degC": np.zeros(SAMPLES)}
    plant = bind(heater.declared(), played).plant
    (effect,) = (e for e in plant.effects if e.name == hidden.effect)
    (q,) = effect.parameters
    assert (hidden.rating, hidden.size) == ("not", q.high)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=list(PLANTS))
def test_every_cause_of_a_rated_plant_acts_where_the_plant_has_a_place(plant: RatedPlant) -> None:
    played = {**plant.inputs(0), **{n: np.zeros(SAMPLES) for n in plant.readings}}
    bound = bind(plant.declared(), played).plant
    places = {p.name for p in bound.places}
    assert all(e.places and set(e.places) <= places for e in bound.effects)
    assert {q.name for q in bound.parameters} == set(plant.bench)


def test_shares_are_of_each_rating_that_has_cases() -> None:
    made = [
        Case(effect="a", rating="identifiable", size=1.0, seed=k, named=k > 0, first="p")
        for k in range(4)
    ]
    assert shares(made) == ["identifiable: place first in 3 of 4, 0.75"]


def test_lines_are_counted_without_comments_and_empty_ones(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("# a\n\n[b]\nc = 1\n")
    assert lines_of(tmp_path / "a.toml") == 2
