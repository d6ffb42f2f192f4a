"""From numbers to a verdict: what since known-good runs counts as unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smad.gap import Settings
from smad.gap.compare.assess import Worth
from smad.gap.compare.verdict import Evidenced, StandsOut, decide, p_unknown
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


def named(gap: Worth, *, tied: bool) -> Evidenced:
    return replace(evidenced(gap, effects=("x",)), tied=tied)


@pytest.mark.parametrize(("shrink", "tied", "free"), [(0.3, 0.0, 0.0), (0.1, 0.0, 1.0)])
def test_a_share_of_the_gap_is_asked_of_a_cause_beside_free_parameters(
    shrink: float, tied: float, free: float
) -> None:
    assert p_unknown(named(worth(8.0, shrink), tied=True), SETTINGS) == tied
    assert p_unknown(named(worth(8.0, shrink), tied=False), SETTINGS) == free


def test_a_cause_that_helps_on_its_own_signals_only_while_the_whole_gap_stays_is_unknown() -> None:
    own = replace(named(worth(8.0, 0.9), tied=False), whole=worth(8.0, 0.08))
    assert p_unknown(own, SETTINGS) == 1.0
    assert p_unknown(replace(own, whole=worth(8.0, 0.15)), SETTINGS) == 0.0


@pytest.mark.parametrize("tied", [True, False])
def test_a_cause_is_unknown_where_a_flexible_correction_takes_twice_as_much(tied: bool) -> None:
    assert p_unknown(named(worth(2.0, 0.42, 0.9), tied=tied), SETTINGS) == 1.0
    assert p_unknown(named(worth(2.0, 0.55, 0.9), tied=tied), SETTINGS) == 0.0


@pytest.mark.parametrize(
    ("refit", "outcome"),
    [(1.0, Outcome.UNKNOWN), (0.8, Outcome.NO_GAP)],
    ids=["beyond it", "not beyond it"],
)
def test_since_a_single_good_run_a_gap_that_nothing_explains_must_exceed_the_threshold(
    refit: float, outcome: Outcome
) -> None:
    assert decide(evidenced(worth(refit, 0.0), threshold=0.9), SETTINGS)[0] is outcome


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
        stands_out=StandsOut("rod", "force_N", 9.0),
    )
    said = dict(numbers(Outcome.UNKNOWN, e, (), p=0.5, where="rod", values=(), unseen=True))
    assert said["gap"].startswith("0.0× the noise floor")
    assert said["stands out"] == "force_N, by 9 times what known-good runs differ in it"
