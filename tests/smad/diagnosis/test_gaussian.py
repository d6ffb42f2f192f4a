import numpy as np
import pytest

from smad.diagnosis.numerics.folds import FoldRows, fold_products
from smad.diagnosis.numerics.gaussian import held_out, log_evidence, posterior


def problem(seed, *, k=4, n=600, folds=6, size=1.0):
    rng = np.random.default_rng(seed)
    responses = rng.standard_normal((k, n))
    x = size * rng.standard_normal(k)
    rows = x @ responses + rng.standard_normal(n)
    return rows, responses, np.arange(n) * folds // n, x


def test_products_of_all_folds_add_up_to_those_of_all_rows():
    rows, responses, fold, _ = problem(1)
    found = fold_products(rows, responses, fold)
    assert found.gram.sum(axis=0) == pytest.approx(responses @ responses.T)
    assert found.against.sum(axis=0) == pytest.approx(responses @ rows)
    assert found.square.sum() == pytest.approx(rows @ rows)


def test_rows_of_no_fold_count_nowhere():
    rows, responses, fold, _ = problem(1)
    fold[:100] = -1
    found = fold_products(rows, responses, fold)
    assert found.square.sum() == pytest.approx(rows[100:] @ rows[100:])


def test_a_choice_of_columns_has_the_products_of_these_columns():
    rows, responses, fold, _ = problem(2)
    chosen = FoldRows(rows, responses, fold).of([3, 1])
    again = fold_products(rows, responses[[3, 1]], fold)
    assert chosen.gram == pytest.approx(again.gram)
    assert chosen.against == pytest.approx(again.against)


def test_the_posterior_is_that_of_the_stacked_least_squares():
    rows, responses, fold, _ = problem(3)
    precision, ridge = np.array([1.0, 2.0, 3.0, 4.0]), 5.0
    found = posterior(fold_products(rows, responses, fold), precision, ridge)
    A = np.vstack([responses.T, np.diag(np.sqrt(ridge * precision))])
    want = np.linalg.lstsq(A, np.r_[rows, np.zeros(4)], rcond=None)[0]
    assert found.mean == pytest.approx(want)
    assert found.covariance == pytest.approx(np.linalg.inv(A.T @ A))


def test_the_evidence_is_that_of_the_joint_normal_distribution():
    rng = np.random.default_rng(4)
    responses, rows = rng.standard_normal((2, 30)), rng.standard_normal(30)
    precision, ridge = np.array([1.0, 3.0]), 0.7
    C = np.eye(30) + responses.T @ np.diag(1.0 / (ridge * precision)) @ responses
    want = -0.5 * (rows @ np.linalg.solve(C, rows) + np.linalg.slogdet(C)[1]) + 0.5 * rows @ rows
    products = fold_products(rows, responses, np.zeros(30, dtype=int))
    assert log_evidence(products, precision, ridge) == pytest.approx(want)


def test_what_is_taken_of_held_out_rows_is_what_the_other_folds_coefficients_take():
    rows, responses, fold, _ = problem(5)
    found = held_out(fold_products(rows, responses, fold), np.ones(4))
    kept = fold != 2
    x = np.linalg.lstsq(responses[:, kept].T, rows[kept], rcond=None)[0]
    left = rows[~kept] - x @ responses[:, ~kept]
    # The ridge is small against 500 rows of a strong signal.
    assert found.taken[2] == pytest.approx(rows[~kept] @ rows[~kept] - left @ left, rel=0.02)


def test_responses_without_a_part_in_the_rows_take_nothing_of_held_out_ones():
    shares = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        rows, responses = rng.standard_normal(400), rng.standard_normal((12, 400))
        products = fold_products(rows, responses, np.arange(400) * 8 // 400)
        shares.append(held_out(products, np.ones(12)).share)
    assert max(shares) < 0.05
    assert float(np.mean(shares)) <= 0.002


def test_the_share_of_held_out_rows_is_that_of_the_signal():
    rows, responses, fold, x = problem(6, n=6000)
    true = float((x @ responses) @ (x @ responses) / (rows @ rows))
    found = held_out(fold_products(rows, responses, fold), np.ones(4))
    assert found.share == pytest.approx(true, abs=0.03)


def test_the_share_does_not_depend_on_the_units_of_the_responses():
    rows, responses, fold, _ = problem(7)
    one = held_out(fold_products(rows, responses, fold), np.ones(4))
    other = held_out(fold_products(rows, 1e4 * responses, fold), np.ones(4))
    assert other.share == pytest.approx(one.share)


def test_a_single_fold_is_refused():
    rows, responses, fold, _ = problem(8, folds=1)
    with pytest.raises(ValueError, match="1 folds"):
        held_out(fold_products(rows, responses, fold), np.ones(4))
