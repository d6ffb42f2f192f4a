"""The place whose law takes most of rows that it was not fitted to."""

from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.places.responses import Candidate
from smad.diagnosis.plant import Effect
from smad.diagnosis.search.names import Naming
from smad.diagnosis.search.refine import Refined
from smad.diagnosis.search.where import fits, where

FOLDS, N, K = 8, 4000, 5
NAMES = ("constant", "a", "b", "c", "d")


def bench(seed, *, strengths, alike=None):
    """Rows with what a term of the places of `strengths` adds; place `alike` responds as place 0"""
    rng = np.random.default_rng(seed)
    responses = rng.standard_normal((6 * K, N)).astype(np.float32)
    if alike is not None:
        own = slice(alike * K, alike * K + K)
        responses[own] = responses[:K] + 0.05 * responses[own]
    rows = rng.standard_normal(N)
    for place, strength in strengths.items():
        rows = rows + strength * responses[place * K + 1 + place % 4]
    laid = FoldRows(rows, responses, np.arange(N) * FOLDS // N)
    candidates = [
        Candidate(f"place-{i}", "both", np.arange(i * K, i * K + K)[:, None], NAMES, (1,) * K)
        for i in range(6)
    ]
    return laid, candidates


LEAST = 80.0


def found_in(laid, candidates, **changes):
    return where(laid, candidates, shipped(), least=LEAST, **changes)


@pytest.mark.parametrize("place", range(6))
def test_the_place_of_a_law_comes_first_with_its_term(place):
    found = found_in(*bench(place, strengths={place: 1.0}))
    assert found.ranked[0].candidate.place == f"place-{place}"
    assert found.ranked[0].share == pytest.approx(0.5, abs=0.05)
    (step,) = found.steps
    assert step.chosen.terms == (NAMES[1 + place % 4], "constant")


def test_a_bench_without_a_change_has_no_place():
    assert not any(found_in(*bench(seed, strengths={})).steps for seed in range(60))


def test_two_places_are_found_one_beside_the_other():
    found = found_in(*bench(3, strengths={1: 1.0, 4: 0.5}))
    assert [s.chosen.candidate.place for s in found.steps] == ["place-1", "place-4"]
    assert found.steps[1].share > found.steps[0].share


def test_no_more_places_are_told_than_allowed():
    laid, candidates = bench(3, strengths={0: 2.0, 1: 1.4, 2: 1.0, 3: 0.7})
    assert len(found_in(laid, candidates, most=2).steps) == 2


def test_a_place_that_takes_too_little_is_not_told():
    laid, candidates = bench(4, strengths={2: 1.0, 5: 0.3})
    assert len(found_in(laid, candidates, worth=0.01).steps) == 2
    assert len(found_in(laid, candidates, worth=0.2).steps) == 1


def test_places_that_respond_alike_are_told_together():
    found = found_in(*bench(5, strengths={0: 1.0}, alike=2))
    assert {s.candidate.place for s in found.steps[0].near} == {"place-0", "place-2"}


def test_the_order_of_the_candidates_changes_nothing():
    laid, candidates = bench(7, strengths={2: 1.0, 5: 0.4})
    one, other = found_in(laid, candidates), found_in(laid, candidates[::-1])
    assert [s.candidate.place for s in one.ranked] == [s.candidate.place for s in other.ranked]
    assert [s.chosen.columns.tolist() for s in one.steps] == [
        s.chosen.columns.tolist() for s in other.steps
    ]


def test_laws_of_several_places_are_fitted_together_and_without_each_fold():
    laid, candidates = bench(8, strengths={1: 1.0, 4: 0.5})
    own = fits(laid, found_in(laid, candidates).steps)
    assert own.columns.tolist() == [1 * K + 2, 1 * K, 4 * K + 1, 4 * K]
    assert own.fit.mean[[0, 2]] == pytest.approx([1.0, 0.5], abs=0.06)
    assert len(own.without) == FOLDS
    kept = laid.fold != 3
    A = laid.responses[own.columns][:, kept].astype(float)
    want = np.linalg.lstsq(A.T, laid.rows[kept], rcond=None)[0]
    assert own.without[3] == pytest.approx(want, abs=1e-4)


def effect(name, *places):
    return Effect(name=name, title="", parameters=(), signals=(), places=places)


def found_with(laid, candidates, change, own, **changes):
    """The search where one effect changes the rows by `change`, and takes what that takes."""

    def refine(effects, z):
        gain = float(2.0 * z @ change - change @ change)
        fit = Refined(own, gain, change, np.zeros((0, N)), np.zeros(0))
        return [fit] if own in effects else []

    naming = Naming((own,), refine)
    return where(
        laid, candidates, shipped(), least=LEAST, naming=naming, effects_stand=True, **changes
    )


def curved(seed):
    """Rows with a change at place 3 that is no law of its terms; the best law is of place 1."""
    laid, candidates = bench(seed, strengths={})
    change = 1.5 * np.sign(laid.responses[3 * K + 1].astype(float)) + 0.4 * laid.responses[K + 2]
    return replace(laid, rows=laid.rows + change), candidates, change


def test_an_effect_that_takes_more_than_any_law_says_where_and_is_the_name():
    laid, candidates, change = curved(9)
    own = effect("kink", "place-3")
    (step,) = found_with(laid, candidates, change, own).steps
    assert step.chosen.candidate.place == "place-3"
    assert step.named
    assert step.entry.name == "kink"
    assert step.share == pytest.approx(0.7, abs=0.05)


def test_an_effect_that_takes_little_of_what_a_law_takes_is_only_the_nearest():
    laid, candidates = bench(10, strengths={1: 1.0})
    small = 0.2 * laid.responses[K + 2].astype(float)
    (step,) = found_with(laid, candidates, small, effect("faint", "place-1")).steps
    assert step.chosen.candidate.place == "place-1"
    assert not step.named
    assert step.entry.name == "faint"
    assert 0.2 < step.takes < 0.5


def test_an_effect_that_acts_at_a_place_that_is_told_already_is_no_name_elsewhere():
    laid, candidates = bench(12, strengths={2: 1.0, 5: 0.6})
    change = laid.responses[2 * K + 3].astype(float)
    first, second = found_with(laid, candidates, change, effect("own", "place-2")).steps
    assert first.named
    assert not second.named


def test_an_effect_that_says_no_place_is_a_name_and_moves_no_place():
    laid, candidates = bench(11, strengths={2: 1.0})
    change = laid.responses[2 * K + 3].astype(float)
    (step,) = found_with(laid, candidates, change, effect("anywhere")).steps
    assert step.chosen.candidate.place == "place-2"
    assert step.named


def test_the_constants_are_few_and_all_have_a_meaning():
    names = Constants.__struct_fields__
    assert len(names) <= 8
    assert all(f"`{name}`" in (Constants.__doc__ or "") for name in names)
