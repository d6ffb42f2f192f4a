"""From numbers to a verdict: what since known-good runs counts as unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from smad.gap import Settings
from smad.gap.compare.assess import Worth
from smad.gap.compare.verdict import Evidenced, Unexplained, decide, p_unknown
from smad.gap.records import Outcome
from smad.gap.report.numbers import gap, numbers

SETTINGS = Settings()


def worth(refit: float, shrink: float, ceiling: float | None = None) -> Worth:
    """Gaps and shrink, known without doubt."""
    most = shrink if ceiling is None else ceiling
    return Worth(
        ("a",), refit, refit * (1 - shrink), shrink, most,
        np.tile([shrink, most], (50, 1)), np.ones(50),
    )  # fmt: skip


def evidenced(gap: Worth, *, effects: tuple[str, ...] = (), threshold: float = 0.35) -> Evidenced:
    return Evidenced(
        effects, {}, dict.fromkeys(effects, 1.0), gap_raw=2 * gap.gap_refit, threshold=threshold,
        touched=gap, whole=gap, moved=False, visible=1.0, chance=1.0, since_good=True, tied=True,
    )  # fmt: skip


def named(gap: Worth, *, tied: bool, taken: float = 0.0) -> Evidenced:
    return replace(evidenced(gap, effects=("x",)), tied=tied, taken=taken)


@pytest.mark.parametrize(
    ("refit", "shrink", "poor"),
    [(8.0, 0.9, 0.0), (8.0, 0.7, 1.0), (2.0, 0.3, 0.0), (2.0, 0.1, 1.0)],
    ids=["most is taken", "a floor is left", "little is left", "hardly anything is taken"],
)
def test_beside_tied_parameters_a_cause_takes_most_of_a_large_gap(
    refit: float, shrink: float, poor: float
) -> None:
    gap = worth(refit, shrink)
    assert p_unknown(named(gap, tied=True), SETTINGS) == poor
    assert p_unknown(named(worth(8.0, 0.7), tied=False), SETTINGS) == 0.0


def test_a_cause_that_helps_on_its_own_signals_only_while_the_whole_gap_stays_is_unknown() -> None:
    own = replace(named(worth(8.0, 0.9), tied=False), whole=worth(8.0, 0.08))
    assert p_unknown(own, SETTINGS) == 1.0
    assert p_unknown(replace(own, whole=worth(8.0, 0.15)), SETTINGS) == 0.0


@pytest.mark.parametrize(("taken", "poor"), [(0.2, 1.0), (0.5, 0.0)])
def test_a_cause_that_makes_good_much_of_what_the_runs_score_worse_is_known(
    taken: float, poor: float
) -> None:
    assert p_unknown(named(worth(8.0, 0.1), tied=True, taken=taken), SETTINGS) == poor
    assert p_unknown(named(worth(8.0, 0.1), tied=False, taken=taken), SETTINGS) == 1.0


@pytest.mark.parametrize(("strongest", "poor"), [(2.9, 1.0), (3.5, 0.0)])
def test_a_cause_that_gains_more_than_a_wrong_one_ever_did_is_known(
    strongest: float, poor: float
) -> None:
    weak = replace(named(worth(8.0, 0.1), tied=True), strongest=strongest)
    assert p_unknown(weak, SETTINGS) == poor
    assert p_unknown(replace(weak, tied=False), SETTINGS) == 1.0


@pytest.mark.parametrize("tied", [True, False])
def test_a_cause_is_unknown_where_a_flexible_correction_takes_twice_as_much(tied: bool) -> None:
    assert p_unknown(named(worth(2.0, 0.42, 0.9), tied=tied), SETTINGS) == 1.0
    assert p_unknown(named(worth(2.0, 0.55, 0.9), tied=tied), SETTINGS) == 0.0


@pytest.mark.parametrize(
    ("refit", "threshold", "outcome"),
    [
        (1.4, 0.35, Outcome.UNKNOWN),
        (1.4, 0.9, Outcome.PARAMETERS),
        (0.8, 0.35, Outcome.PARAMETERS),
    ],
    ids=["large", "not far beyond what good runs show", "not large"],
)
def test_a_gap_that_nothing_explains_must_be_large_and_far_beyond_the_background(
    refit: float, threshold: float, outcome: Outcome
) -> None:
    assert decide(evidenced(worth(refit, 0.0), threshold=threshold), SETTINGS)[0] is outcome


def test_a_probability_since_good_runs_is_scaled_by_how_often_such_answers_were_right() -> None:
    outcome, p = decide(evidenced(worth(5.0, 1.0), effects=("x",)), SETTINGS)
    assert (outcome, p) == (Outcome.EFFECT, pytest.approx(SETTINGS.named_right))


def test_runs_that_excite_too_little_are_no_matter_of_how_often_names_were_right() -> None:
    starved = replace(evidenced(worth(0.0, 0.0)), visible=0.1)
    assert decide(starved, SETTINGS) == (Outcome.NO_EXCITATION, pytest.approx(0.9))


def test_a_cause_that_other_parameters_predict_as_well_has_even_odds_and_the_verdict_says_so() -> (
    None
):
    sure = named(worth(2.0, 0.9), tied=True)
    open_ = replace(sure, imitated=True)
    outcome, p = decide(open_, SETTINGS)
    assert outcome is decide(sure, SETTINGS)[0] is Outcome.EFFECT
    assert p == pytest.approx(SETTINGS.unsure_right)
    assert "as well as the cause" in gap(open_)
    assert "as well as the cause" not in gap(sure)


@pytest.mark.parametrize("tied", [False, True])
def test_a_gap_of_exactly_zero_with_an_unknown_cause_is_put_into_words(tied: bool) -> None:
    e = replace(
        evidenced(worth(0.0, 0.0)),
        tied=tied,
        unexplained=Unexplained(0.0, 9.0, 0.0, "rod", "force_N"),
    )
    said = dict(numbers(Outcome.UNKNOWN, e, (), p=0.5, where="rod", values=(), unseen=True))
    assert said["gap"].startswith("0.0× the noise floor")
    assert said["stands out"] == "force_N, by 9 times what known-good runs differ in it"
