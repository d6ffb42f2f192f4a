"""Other laboratories' numbers: what the table says is what the plant gives."""

import pytest

from sim_device.plant.published import NUMBERS, SOURCES, inside_of, near_of


def test_every_number_has_a_source_and_one_that_is_not_computed_names_what_is_missing() -> None:
    assert {number.source for number in NUMBERS} == set(SOURCES)
    assert all(number.missing for number in NUMBERS if number.ours is None)


def test_half_of_the_computed_numbers_are_near() -> None:
    near, judged = near_of()
    assert (near, judged) == (25, 44)


def test_a_published_value_lies_in_the_interval_that_its_source_states_and_most_of_ours_do() -> (
    None
):
    assert inside_of() == (9, 13)
    for number in NUMBERS:
        if number.stated is not None:
            assert number.stated[0] <= number.value <= number.stated[1], number.what


def test_a_computed_number_that_is_not_near_names_what_is_missing() -> None:
    for number in NUMBERS:
        if number.ours is not None and not number.near:
            assert number.missing, number.what


def test_the_coils_film_gives_what_it_was_fitted_to() -> None:
    for number in NUMBERS:
        if number.fitted:
            assert number.ratio == pytest.approx(1.0, abs=0.04)
