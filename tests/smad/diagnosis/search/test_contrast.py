"""What is new in some runs, beside what all runs share; and the run that is of another state."""

import numpy as np
import pytest

from smad.diagnosis.constants import shipped
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.numerics.forward import held_out
from smad.diagnosis.places.responses import Candidate
from smad.diagnosis.search.contrast import apart, contrast
from smad.diagnosis.search.where import fits

PLACES, K, RUNS, ROWS = 5, 3, 6, 500
NAMES = ("constant", "a", "b")


def runs_of(seed, *, shared=None, new=None):
    """Six runs, the last two in question; the first term of some places in all, or in these."""
    rng = np.random.default_rng(seed)
    run_of_row = np.repeat(np.arange(RUNS), ROWS)
    asked = run_of_row >= RUNS - 2
    responses = rng.standard_normal((PLACES * K, RUNS * ROWS)).astype(np.float32)
    rows = rng.standard_normal(RUNS * ROWS)
    for place, strength in (shared or {}).items():
        rows = rows + strength * responses[place * K + 1]
    for place, strength in (new or {}).items():
        rows = rows + strength * responses[place * K + 1] * asked
    candidates = [
        Candidate(f"place-{i}", "both", np.arange(i * K, i * K + K)[:, None], NAMES, (1,) * K)
        for i in range(PLACES)
    ]
    both = np.concatenate([responses, responses * asked])
    return FoldRows(rows, both, run_of_row), np.flatnonzero(asked), candidates


def news(rows, asked, candidates):
    only = tuple(k >= RUNS - 2 for k in range(RUNS))
    run_of_row = np.repeat(np.arange(RUNS), ROWS)
    return contrast(
        rows, asked, candidates, shipped(), run_of_row=run_of_row, only=only, worth=0.08
    )


def places(found):
    return [s.chosen.candidate.place for s in found.steps]


@pytest.mark.parametrize("place", range(PLACES))
def test_a_law_that_only_the_runs_in_question_have_is_new_with_its_share(place):
    found = news(*runs_of(place, new={place: 1.0}))
    assert places(found) == [f"place-{place}"]
    assert found.steps[0].chosen.terms[0] == "a"
    assert found.steps[0].share == pytest.approx(0.5, abs=0.1)


def test_a_law_that_all_runs_share_is_not_new():
    found = news(*runs_of(1, shared={2: 3.0}))
    assert found.steps == ()
    assert found.ranked[0].share < 0.02


def test_runs_without_anything_new_have_nothing_new():
    assert not any(news(*runs_of(seed)).steps for seed in range(20))


def test_what_is_new_is_found_beside_a_stronger_law_of_all_runs_and_has_its_own_coefficient():
    found = news(*runs_of(3, shared={0: 1.0, 2: 0.5}, new={2: 1.0}))
    assert places(found) == ["place-2"]
    own = fits(found.own, found.steps)
    assert own.columns[0] == 2 * K + 1
    assert own.fit.mean[0] == pytest.approx(1.0, abs=0.1)


def test_two_new_places_come_the_larger_first_and_add_up():
    found = news(*runs_of(4, new={1: 0.7, 3: 1.2}))
    assert places(found) == ["place-3", "place-1"]
    assert found.steps[1].share > found.steps[0].share
    alone = {s.candidate.place: s.share for s in found.ranked}
    assert alone["place-3"] == max(alone.values())


def test_the_order_of_the_candidates_does_not_matter():
    rows, asked, candidates = runs_of(5, shared={0: 1.0}, new={4: 1.0})
    one, other = news(rows, asked, candidates), news(rows, asked, candidates[::-1])
    assert places(one) == places(other)
    assert [s.share for s in one.ranked] == pytest.approx([s.share for s in other.ranked])


def states(seed, strengths):
    rows, _, _ = runs_of(seed)
    run_of_row = rows.fold
    own = np.array(strengths)[run_of_row]
    return FoldRows(rows.rows + own * rows.responses[1], rows.responses, rows.fold), run_of_row


@pytest.mark.parametrize("odd", range(RUNS))
def test_the_run_whose_law_is_another_is_apart(odd):
    rows, run_of_row = states(odd, [-2.0 if k == odd else 2.0 for k in range(RUNS)])
    shares = [apart(rows, run_of_row, [np.array([1]), np.array([5])], k) for k in range(RUNS)]
    assert shares[odd] > 0.8
    assert max(s for k, s in enumerate(shares) if k != odd) < 0.3


def test_runs_of_one_state_are_not_apart():
    rows, run_of_row = states(7, [2.0] * RUNS)
    assert max(apart(rows, run_of_row, [np.array([1, 2])], k) for k in range(RUNS)) < 0.02


def test_coefficients_with_priors_take_what_is_there_and_little_of_what_priors_forbid():
    rows, _ = states(8, [0.8] * RUNS)
    loose = FoldRows(rows.rows, rows.responses[1:2], rows.fold)
    tight = FoldRows(rows.rows, 1e-3 * rows.responses[1:2], rows.fold)
    folds = np.arange(RUNS)
    assert held_out(loose.products(), folds, prior=1.0) / rows.square == pytest.approx(
        0.64 / 1.64, abs=0.05
    )
    assert held_out(tight.products(), folds, prior=1.0) / rows.square < 0.01
