"""Few responses are selected, and judged on folds that had no part in it."""

import numpy as np
import pytest

from smad.diagnosis.numerics.forward import FoldRows, fitted, forward

SINGLE = np.arange(4)[:, None]
ALIKE = np.ones(4)


def problem(seed, *, x=(1.0, 0.0, 0.0, 0.0), n=800, folds=8):
    rng = np.random.default_rng(seed)
    responses = rng.standard_normal((len(x), n)).astype(np.float32)
    rows = np.array(x) @ responses + rng.standard_normal(n)
    return FoldRows(rows, responses, np.arange(n) * folds // n)


def products(rows):
    return rows.products()


def test_products_of_all_folds_add_up_to_those_of_all_rows():
    rows = problem(1)
    A = rows.responses.astype(float)
    found = products(rows)
    assert found.gram.sum(axis=0) == pytest.approx(A @ A.T)
    assert found.against.sum(axis=0) == pytest.approx(A @ rows.rows)


def test_rows_of_no_fold_count_nowhere():
    rows = problem(1)
    rows.fold[:100] = -1
    A = rows.responses[:, 100:].astype(float)
    assert products(rows).against.sum(axis=0) == pytest.approx(A @ rows.rows[100:])


def test_products_are_in_the_order_that_was_asked_for():
    rows = problem(2)
    found = rows.products(np.array([0, 3, 1]))
    A = rows.responses[[0, 3, 1]].astype(float)
    assert found.against.sum(axis=0) == pytest.approx(A @ rows.rows)


@pytest.mark.parametrize("true", range(4))
def test_the_response_that_is_in_the_rows_is_the_only_one_selected(true):
    x = np.zeros(4)
    x[true] = 0.6
    found = forward(products(problem(true, x=x)), SINGLE, ALIKE, depth=3)
    assert found.chosen == (true,)


def test_responses_without_a_part_in_the_rows_take_nothing_of_held_out_ones():
    shares = []
    for seed in range(40):
        rows = problem(seed, x=(0.0,) * 4)
        shares.append(
            forward(products(rows), SINGLE, ALIKE, depth=3).best / (rows.rows @ rows.rows)
        )
    assert max(shares) < 0.02
    assert float(np.mean(shares)) < 0.003


def test_what_is_taken_of_a_fold_is_what_the_other_folds_coefficients_take():
    rows = problem(5)
    found = forward(products(rows), SINGLE, ALIKE, depth=1)
    kept, A = rows.fold != 2, rows.responses[0].astype(float)
    x = (A[kept] @ rows.rows[kept]) / (A[kept] @ A[kept])
    left = rows.rows[~kept] - x * A[~kept]
    own = rows.rows[~kept]
    assert found.taken[1, 2] == pytest.approx(own @ own - left @ left, rel=1e-4)


def test_the_group_without_which_most_is_lost_comes_first():
    found = forward(products(problem(6, x=(0.5, 0.0, 1.0, 0.0))), SINGLE, ALIKE, depth=3)
    assert found.chosen == (2, 0)


def test_of_two_that_take_the_same_the_one_that_is_worth_more_enters():
    rows = problem(7)
    rows.responses[1] = rows.responses[0]
    for first in (0, 1):
        worth = np.full(4, 0.9)
        worth[first] = 1.0
        assert forward(products(rows), SINGLE, worth, depth=2).chosen == (first,)


def test_what_is_always_in_is_never_selected_and_fitted_beside():
    rows = problem(8, x=(1.0, 0.7, 0.0, 0.0))
    found = forward(products(rows), SINGLE[1:], ALIKE[1:], depth=2, before=1)
    assert found.chosen == (0,)
    assert found.taken[0].sum() > 0.0


def test_the_fit_is_that_of_least_squares():
    rows = problem(9, x=(1.0, -2.0, 0.5, 0.0))
    found = fitted(rows.products(np.arange(3)))
    A = rows.responses[:3].astype(float)
    assert found == pytest.approx(np.linalg.lstsq(A.T, rows.rows, rcond=None)[0], abs=1e-4)


def test_the_choice_does_not_depend_on_the_units_of_the_responses():
    rows = problem(10, x=(0.5, 0.0, 1.0, 0.0))
    one = forward(products(rows), SINGLE, ALIKE, depth=3)
    rows.responses[:] *= np.float32(1e4)
    other = forward(products(rows), SINGLE, ALIKE, depth=3)
    assert other.chosen == one.chosen
    assert other.taken == pytest.approx(one.taken, rel=1e-3)


def test_a_single_fold_is_refused():
    with pytest.raises(ValueError, match="1 folds"):
        forward(products(problem(11, folds=1)), SINGLE, ALIKE, depth=1)
