"""Odds of hypotheses: every channel has its say, and what is told are probabilities."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.search.odds import Hypothesis, odds, of_places, shares, told

NOISE = 100.0


def constants(**changes: float) -> Constants:
    return msgspec.structs.replace(shipped(), **changes)


def law(place: str, *gains: float) -> Hypothesis:
    return Hypothesis(place=place, gains=np.array(gains))


def effect(name: str, place: str, *gains: float) -> Hypothesis:
    return Hypothesis(place=place, effect=name, gains=np.array(gains))


def test_a_hypothesis_that_is_right_about_every_channel_beats_one_that_takes_more_of_one() -> None:
    loud, right = law("loud", 1e6, -400.0), law("right", 9e5, 2e3)
    first = of_places([loud, right], odds([loud, right], shipped(), NOISE))
    assert next(iter(first)) == "right"


def test_a_channel_in_which_nothing_stands_out_of_the_noise_hardly_counts() -> None:
    gains = np.array([[1e4, 0.0], [1e4, 1.0]])
    few = shares(gains, NOISE, gains.max(axis=0))
    assert few[1] - few[0] < 0.01
    many = np.array([[1e4, 0.0], [1e4, 1e4]])
    assert shares(many, NOISE, many.max(axis=0)) == pytest.approx([0.5, 1.0])


def test_shares_do_not_depend_on_the_unit_of_what_is_far_above_the_noise() -> None:
    gains = np.array([[3e8, 1e8], [1e8, 2e8]])
    one = shares(gains, NOISE, gains.max(axis=0))
    other = shares(0.1 * gains, 0.1 * NOISE, 0.1 * gains.max(axis=0))
    assert one == pytest.approx(other)


def test_probabilities_are_positive_and_add_to_one() -> None:
    found = [law("a", 5.0, 1.0), law("b", 2.0, 3.0), effect("kink", "b", 1.0, 3.0)]
    p = odds(found, shipped(), NOISE)
    assert (p > 0.0).all()
    assert p.sum() == pytest.approx(1.0)
    assert of_places(found, p)["b"] == pytest.approx(p[1] + p[2])


def test_an_effect_that_takes_as_much_as_a_law_is_likelier_by_its_odds() -> None:
    c = constants(effect_odds=np.log(9.0))
    p = odds([law("a", 4.0), effect("kink", "a", 4.0)], c, NOISE)
    assert p == pytest.approx([0.1, 0.9], abs=0.01)


def test_as_few_places_are_told_as_hold_the_level() -> None:
    places = {"a": 0.6, "b": 0.25, "c": 0.1, "d": 0.05}
    assert told(places, 0.5) == ["a"]
    assert told(places, 0.8) == ["a", "b"]
    assert told(places, 0.86) == ["a", "b", "c"]
    assert told(places, 1.0) == ["a", "b", "c", "d"]
