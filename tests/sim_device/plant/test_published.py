"""Other laboratories' numbers: what the table says is what the plant gives."""

import pytest

from sim_device.plant.published import NUMBERS, SOURCES, inside_of, near_of


def test_every_number_has_a_source_and_one_that_is_not_computed_names_what_is_missing() -> None:
    assert {number.source for number in NUMBERS} == set(SOURCES)
    assert all(number.missing for number in NUMBERS if number.ours is None)


def test_most_computed_numbers_are_near() -> None:
    near, judged = near_of()
    assert (near, judged) == (10, 16)


def test_all_whose_source_states_an_interval_lie_in_it() -> None:
    assert inside_of() == (4, 4)
    for number in NUMBERS:
        if number.stated is not None:
            assert number.stated[0] <= number.value <= number.stated[1]


def test_a_computed_number_that_is_not_near_names_what_is_missing() -> None:
    for number in NUMBERS:
        if number.ours is not None and not number.near:
            assert number.missing, number.what


def test_the_heats_that_d_states_fit_the_times_of_k_better_and_those_of_d_worse() -> None:
    for number in NUMBERS:
        if number.with_heats is not None:
            assert number.ratio is not None
            further = abs(number.with_heats() / number.value - 1.0) > abs(number.ratio - 1.0)
            assert further == (number.source == "D"), number.what


def test_the_law_of_the_pitch_gives_what_it_was_fitted_to() -> None:
    for number in NUMBERS:
        if number.fitted:
            assert number.ratio == pytest.approx(1.0, abs=0.03)
