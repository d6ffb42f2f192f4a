"""Energy: where the heat of a run went, and what the paper's numbers make or lose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_device.plant import Drive, Plant, load_parameters
from sim_device.plant.effects.registry import EFFECTS


def driven(plant, legs, dt_s=0.01):
    """Run legs of (seconds, Drive); returns the plant."""
    for seconds, drive in legs:
        for _ in range(round(seconds / dt_s)):
            plant.advance(drive, dt_s)
    return plant


CYCLE = [
    (8.0, Drive(i_A=(3.5, 0.0))),
    (12.0, Drive(pump_duty=(0.9, 0.0))),
    (8.0, Drive(i_A=(0.0, 3.5))),
    (12.0, Drive(pump_duty=(0.3, 0.9))),
]


@pytest.mark.parametrize("name", ["A", "B", "conserving"])
@pytest.mark.parametrize("options", [{}, {"variant": "printed"}, {"cooling": "air"}])
def test_heat_in_is_heat_out_plus_stored_plus_work_plus_the_named_terms(name, options):
    book = driven(Plant(load_parameters(name), **options), CYCLE).energy
    assert book.heat_in > 50.0
    assert abs(book.closing) < 1e-6 * book.heat_in


def test_the_conserving_set_closes_within_a_tenth_of_a_per_cent_without_named_terms():
    book = driven(Plant(load_parameters("conserving")), CYCLE).energy
    assert book.unequal == 0.0
    assert book.omitted_work == 0.0
    out = book.heat_to_water + book.heat_to_air + book.stored
    assert book.heat_in + book.work_on == pytest.approx(out, rel=1e-6)


def test_over_a_closed_cycle_the_conserving_set_gives_back_all_its_heat():
    plant = driven(Plant(load_parameters("conserving")), [*CYCLE, (120.0, Drive(pump_duty=(1, 1)))])
    before = plant.energy
    assert plant.heat_in_J == before.heat_in
    after = driven(plant, [*CYCLE, (120.0, Drive(pump_duty=(1, 1)))]).energy
    stored = after.stored - before.stored
    heat_in = after.heat_in - before.heat_in
    assert abs(stored) < 2e-3 * heat_in
    assert after.heat_to_water + after.heat_to_air - (
        before.heat_to_water + before.heat_to_air
    ) == pytest.approx(heat_in, rel=3e-3)


@pytest.mark.parametrize(("name", "most", "least"), [("A", -0.21, -0.16), ("B", -0.37, -0.33)])
def test_the_papers_unequal_numbers_lose_heat_and_the_book_says_how_much(name, most, least):
    book = driven(Plant(load_parameters(name)), [*CYCLE, (120.0, Drive(pump_duty=(1, 1)))]).energy
    assert most * book.heat_in < book.unequal < least * book.heat_in
    out = book.heat_to_water + book.heat_to_air + book.stored
    assert out == pytest.approx(book.heat_in + book.unequal, rel=1e-3)


def test_work_of_the_stage_on_a_stretched_spring_is_the_integral_of_force():
    plant = Plant(load_parameters("conserving"), fixture="stretch")
    stage = np.linspace(0, 60e-3, 6001)
    force = np.zeros(stage.size)
    for k in range(1, stage.size):
        plant.advance(Drive(stage_m=float(stage[k])), 0.01)
        force[k] = plant.truth.force_N
    work = np.trapezoid(force, stage)
    assert plant.energy.work_on == pytest.approx(work, rel=1e-5)
    assert abs(plant.energy.closing) < 1e-8


def test_friction_takes_work_out_of_the_pair():
    rubbing = Plant(load_parameters("conserving"), effects={"tube_friction": {"coulomb_N": 0.1}})
    book = driven(rubbing, CYCLE).energy
    assert book.work_on < -1e-4
    assert abs(book.closing) < 1e-6 * book.heat_in


drives = st.builds(
    Drive,
    i_A=st.tuples(st.floats(0, 4), st.floats(0, 4)),
    pump_duty=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    drain=st.tuples(st.booleans(), st.booleans()),
)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    st.lists(st.tuples(st.floats(0.1, 3.0), drives), min_size=1, max_size=6),
    st.sampled_from(["A", "conserving"]),
    st.sampled_from([1e-3, 1e-2]),
)
def test_the_books_close_for_any_drive(legs, name, step_s):
    plant = driven(Plant(load_parameters(name), max_step_s=step_s), legs)
    assert abs(plant.energy.closing) < 1e-3 * max(plant.energy.heat_in, 1e-3)
    assert abs(plant.energy.closing) < 1e-6


HEAT_EFFECTS = [e.name for e in EFFECTS if e.subsystem in ("thermal", "water", "phase")]


@pytest.mark.parametrize("name", HEAT_EFFECTS)
def test_the_books_close_with_an_effect_on_heat_or_phase(name):
    variant = "printed" if name == "water_warming" else "extended"
    plant = Plant(load_parameters("A"), variant=variant, effects={name: {}})
    book = driven(plant, CYCLE).energy
    assert abs(book.closing) < 1e-4 * book.heat_in
