import numpy as np
import pytest

from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.search.where import Candidate, where

FOLDS, N, K = 8, 4000, 5


def bench(seed, *, strengths, alike=None):
    """Rows with what the places of `strengths` add; place `alike` responds nearly as place 0."""
    rng = np.random.default_rng(seed)
    responses = rng.standard_normal((6 * K, N))
    if alike is not None:
        own = slice(alike * K, alike * K + K)
        responses[own] = responses[:K] + 0.05 * rng.standard_normal((K, N))
    rows = rng.standard_normal(N)
    for place, strength in strengths.items():
        law = rng.standard_normal(K)
        added = law @ responses[place * K : place * K + K]
        rows = rows + strength * added / added.std()
    laid = FoldRows(rows, responses, np.arange(N) * FOLDS // N)
    candidates = [
        Candidate(f"place-{i}", "both", np.arange(i * K, i * K + K), np.ones(K)) for i in range(6)
    ]
    return laid, candidates


@pytest.mark.parametrize("place", range(6))
def test_the_place_of_a_law_comes_first(place):
    found = where(*bench(place, strengths={place: 1.0}))
    assert found.ranked[0].candidate.place == f"place-{place}"
    assert found.ranked[0].share == pytest.approx(0.5, abs=0.05)
    assert [s.chosen.place for s in found.steps] == [f"place-{place}"]


def test_a_bench_without_a_change_has_no_place():
    told = sum(bool(where(*bench(seed, strengths={})).steps) for seed in range(60))
    # One in twenty is what `LEVEL` allows.
    assert told <= 6


def test_two_places_are_found_one_beside_the_other():
    found = where(*bench(3, strengths={1: 1.0, 4: 0.5}))
    assert [s.chosen.place for s in found.steps] == ["place-1", "place-4"]
    assert found.steps[1].share > found.steps[0].share


def test_places_that_respond_alike_are_told_together():
    found = where(*bench(5, strengths={0: 1.0}, alike=2))
    assert {c.place for c in found.steps[0].near} == {"place-0", "place-2"}


def test_the_order_of_the_candidates_changes_nothing():
    laid, candidates = bench(7, strengths={2: 1.0, 5: 0.4})
    one, other = where(laid, candidates), where(laid, candidates[::-1])
    assert [s.candidate.name for s in one.ranked] == [s.candidate.name for s in other.ranked]
    assert [s.chosen.name for s in one.steps] == [s.chosen.name for s in other.steps]


def test_a_side_is_part_of_a_candidates_name():
    column = np.arange(1)
    assert Candidate("resistance", "x", column, np.ones(1)).name == "resistance X"
    assert Candidate("force cell", "both", column, np.ones(1)).name == "force cell"
