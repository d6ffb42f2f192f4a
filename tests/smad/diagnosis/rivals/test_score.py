"""Probabilities of rivals: whether anything is missing, and which cause it is."""

from __future__ import annotations

import numpy as np
import pytest

from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.rivals.rival import tempered_constants
from smad.diagnosis.rivals.score import (
    EFFECT,
    LAW,
    NOTHING,
    PARAMETERS,
    credible_set,
    effective_rows,
    log_scores,
    probabilities,
    quiet_gap,
)

TEMPER = Constants(evidence=1.6, nothing=5.5, parameters=0.1, effect=3.0, credible_level=0.97)
KINDS = (NOTHING, PARAMETERS, EFFECT, EFFECT, LAW)
NEAR = (True, True, False, False, False)
RUNS, ROWS = 8, 23.0
"""Runs that judge, and independent rows of each run and channel."""


def of(
    leads: tuple[float, ...], *, at_floor: tuple[bool, ...] = NEAR, by_rows: bool = True
) -> list[float]:
    """Probabilities of rivals whose scores over all runs lead the first one by so much."""
    scores = np.array([[lead / RUNS] * RUNS for lead in leads])
    return [float(x) for x in weighed(scores, at_floor=at_floor, by_rows=by_rows)]


def weighed(
    scores: np.ndarray,
    *,
    at_floor: tuple[bool, ...] = NEAR,
    by_rows: bool,
    log_prior: tuple[float, ...] = (0.0,) * len(KINDS),
) -> np.ndarray:
    """Probabilities of rivals with these scores in each run, (rivals, runs)."""
    return probabilities(
        scores,
        KINDS,
        TEMPER,
        effects=41,
        laws=20,
        rows=ROWS,
        at_floor=at_floor,
        by_rows=by_rows,
        log_prior=np.array(log_prior),
    )


def missing(
    leads: tuple[float, ...], *, at_floor: tuple[bool, ...] = NEAR, by_rows: bool = True
) -> float:
    """The probability that anything is missing."""
    return sum(of(leads, at_floor=at_floor, by_rows=by_rows)[2:])


@pytest.mark.parametrize(("least", "counts_below"), [(1.0, False), (0.0, True)])
def test_what_is_left_below_a_floor_counts_only_where_repeats_have_shown_the_floor(
    least: float, counts_below: bool
) -> None:
    rows = np.full((1, 3), 200.0)
    half, nothing, less = (
        log_scores(np.array([[below, much, 0.0]]) * rows, rows, least)[0]
        for below, much in ((0.25, 900.0), (0.0, 900.0), (0.25, 290.0))
    )
    assert bool(nothing > half) is counts_below
    assert less > half + 1.0


def test_a_run_that_broke_off_counts_as_much_less_as_it_is_shorter() -> None:
    rows = np.array([[200.0, 200.0], [8.0, 0.0], [200.0, 192.0]])
    whole, short, third = log_scores(np.full_like(rows, 3.0) * rows, rows, 0.0)
    assert short == pytest.approx(8.0 / 400.0 * whole)
    assert third == pytest.approx(392.0 / 400.0 * whole)
    even = np.full((3, 2), 200.0)
    np.testing.assert_allclose(log_scores(3.0 * even, even, 0.0), -2.0 * np.log(4.0), rtol=1e-12)


@pytest.mark.parametrize("leads", [(0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 3.0, 9.0, -2.0, 700.0)])
def test_probabilities_sum_to_one(leads: tuple[float, ...]) -> None:
    assert sum(of(leads)) == pytest.approx(1.0)


@pytest.mark.parametrize("runs", [1, 2, 4, 8])
def test_probabilities_do_not_depend_on_the_order_of_the_runs(runs: int) -> None:
    rng = np.random.default_rng(runs)
    scores = rng.normal(0.0, 2.0, (len(KINDS), runs))
    orders = [scores, scores[:, ::-1], scores[:, rng.permutation(runs)]]
    first, *others = (weighed(order, by_rows=False) for order in orders)
    for other in others:
        assert other == pytest.approx(first, abs=1e-9)


def test_a_small_lead_in_every_run_is_noticed_where_every_row_counts_and_not_where_few_do() -> None:
    small = (0.0, 0.0, 1.0, 0.0, 0.0)
    assert missing(small) > 0.9
    assert missing(small, by_rows=False) < 0.1


@pytest.mark.parametrize("at_floor", [(False,) * 5, (False, True, True, False, False)])
def test_what_leaves_a_little_more_than_parameters_is_possible_where_both_leave_much_or_nothing(
    at_floor: tuple[bool, ...],
) -> None:
    behind = (0.0, 20.0, 19.0, 0.0, 0.0)
    assert missing(behind) < 1e-3
    assert missing(behind, at_floor=at_floor) > 0.1


def test_what_leads_by_chance_is_not_noticed() -> None:
    assert missing((0.0, 0.1, 0.1, 0.05, 0.1)) < 0.1


def test_a_lead_that_hangs_on_one_run_is_less_sure_than_the_same_lead_in_every_run() -> None:
    even, one = np.zeros((2, RUNS)), np.zeros((2, RUNS))
    even[1], one[1, 0] = 2.0 / RUNS, 2.0
    of_parts = [
        probabilities(
            x,
            (NOTHING, EFFECT),
            TEMPER,
            effects=41,
            laws=20,
            rows=ROWS,
            at_floor=(True, False),
            by_rows=True,
            log_prior=np.zeros(2),
        )[1]
        for x in (even, one)
    ]
    assert of_parts[1] < 0.75 < of_parts[0]


def test_of_two_effects_the_better_one_is_not_sure_however_many_runs_there_are() -> None:
    for runs in (RUNS, 4 * RUNS):
        scores = np.array([[0.0] * runs, [1.0] * runs, [1.1] * runs])
        p = probabilities(
            scores,
            (NOTHING, EFFECT, EFFECT),
            TEMPER,
            effects=41,
            laws=20,
            rows=ROWS,
            at_floor=(False,) * 3,
            by_rows=True,
            log_prior=np.zeros(3),
        )
        assert 0.75 < p[2] / (p[1] + p[2]) < 0.85


def test_a_law_that_leaves_much_less_does_not_say_that_the_cause_is_not_in_the_library() -> None:
    effect = np.exp(TEMPER.effect) / (np.exp(TEMPER.effect) + 1.0)
    better, worse, law = of((0.0, 0.0, 100.0, 90.0, 400.0))[2:]
    assert better == pytest.approx(0.5 * effect, rel=0.05)
    assert worse < 1e-3 * better
    assert law == pytest.approx(1.0 - better, abs=1e-3)


def test_a_cause_that_leaves_as_much_as_moved_parameters_is_likelier_if_it_moves_them_less() -> (
    None
):
    scores = np.array([[-200.0], [0.0], [-0.2], [-0.3], [-200.0]]) / RUNS * np.ones(RUNS)

    def of_second(log_prior: float) -> float:
        priors = (0.0, -15.0, -15.0, log_prior, 0.0)
        p = weighed(scores, at_floor=(False,) * 5, by_rows=False, log_prior=priors)
        return float(p[3] / (p[2] + p[3]))

    assert of_second(-15.0) < 0.5
    assert of_second(-7.0) > 0.9


def test_few_signals_say_as_much_together_as_many() -> None:
    ten, one = (
        tempered_constants(shipped(), free=True),
        tempered_constants(shipped(), free=True, channels=1),
    )
    assert one.evidence == pytest.approx(10.0 * ten.evidence)


def test_after_a_cause_every_row_counts_for_what_leaves_nothing_against_what_leaves_more() -> None:
    small = (0.0, 0.0, 1.0, 0.0, 0.0)
    assert missing(small, by_rows=False, at_floor=(False, False, True, False, False)) > 0.9
    assert missing(small, by_rows=False, at_floor=(True, True, True, False, False)) < 0.1


def test_an_effect_that_explains_nothing_is_no_cause_however_soft_the_evidence_is() -> None:
    p = of((0.0, 0.0, 2.0, -0.5, 0.0))
    assert p[3] < 0.01 * p[2]


def test_what_good_runs_leave_above_the_noise_counts_as_few_rows_however_long_a_run_is() -> None:
    kappa = TEMPER.evidence
    assert effective_rows(ROWS, 0.0, kappa, 4) == pytest.approx(ROWS)
    assert effective_rows(1000.0, 1.0, kappa, 1000) == pytest.approx(kappa, rel=0.01)
    assert effective_rows(1000.0, 1.0, kappa, 1) == pytest.approx(0.5 * kappa)
    assert effective_rows(ROWS, 0.1, kappa, 4) > 0.7 * ROWS


@pytest.mark.parametrize(("runs", "good"), [(1, 4), (3, 2)])
def test_an_error_of_form_may_leave_more_of_new_runs_than_of_the_good_ones_in_one_of_100(
    runs: int, good: int
) -> None:
    rng = np.random.default_rng(1)
    new, floor = (rng.chisquare(n * 2.5, 100_000) / (n * 2.5) for n in (runs, good))
    assert quiet_gap(0.0, 2.5, runs, good) == pytest.approx(1.35)
    most = quiet_gap(1.0, 2.5, runs, good)
    assert np.mean(np.sqrt(new / floor) > most) == pytest.approx(0.01, abs=0.002)


@pytest.mark.parametrize(("level", "names"), [(0.5, "a"), (0.6, "a"), (0.85, "ab"), (0.95, "abc")])
def test_a_credible_set_has_the_fewest_that_hold_its_level(level: float, names: str) -> None:
    assert credible_set({"c": 0.1, "b": 0.3, "a": 0.6}, level) == list(names)
