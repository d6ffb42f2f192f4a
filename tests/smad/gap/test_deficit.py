"""What runs score worse than known-good runs, and the output that good runs hardly differ in."""

from __future__ import annotations

from dataclasses import replace

import pytest

from smad.gap import Settings
from smad.gap.compare.verdict import Unexplained, decide
from smad.gap.fit.deficit import Deficit, Usual, clearest, worst_run
from smad.gap.records import Outcome
from tests.smad.gap.cases import OTHER, SHOWN, ask, bank, without
from tests.smad.gap.test_decisions import evidenced, worth

SETTINGS = Settings()


def test_the_output_that_stands_out_does_so_whichever_model_is_asked() -> None:
    usual = Usual({"a": -20.0, "b": -20.0}, {"a": 2.0, "b": 4.0})
    tied = Deficit(9.0, {"a": 30.0, "b": 30.0}, {("a", "r"): 40.0, ("b", "s"): 30.0})
    free = Deficit(5.0, {"a": 4.0, "b": 24.0}, {("a", "r"): 10.0, ("b", "s"): 25.0})
    assert clearest(usual, [tied]) == ("a", 15.0)
    assert clearest(usual, [tied, free]) == ("b", 6.0)
    assert worst_run([tied]) == ("a", "r", 40.0)
    assert worst_run([tied, free]) == ("b", "s", 25.0)


@pytest.mark.parametrize(
    ("deficit", "spreads", "output", "outcome"),
    [
        (9.0, 1.0, "", Outcome.UNKNOWN),
        (1.0, 1.0, "", Outcome.PARAMETERS),
        (1.0, 30.0, "a", Outcome.UNKNOWN),
    ],
    ids=["worse everywhere", "large in a few places only", "one output stands out"],
)
def test_a_large_gap_is_unknown_only_where_the_runs_score_worse_than_good_ones(
    deficit: float, spreads: float, output: str, outcome: Outcome
) -> None:
    seen = replace(
        evidenced(worth(3.0, 0.0)), unexplained=Unexplained(deficit, spreads, 0.0, output, output)
    )
    assert decide(seen, SETTINGS)[0] is outcome


def test_a_small_gap_is_unknown_where_one_output_differs_as_good_ones_never_do() -> None:
    small = replace(evidenced(worth(0.5, 0.0)), unexplained=Unexplained(1.0, 30.0, 40.0, "a", "a"))
    outcome, p = decide(small, SETTINGS)
    assert outcome is Outcome.UNKNOWN
    assert p > 0.4
    quiet = replace(small, unexplained=Unexplained(1.0, 3.0, 40.0))
    assert decide(quiet, SETTINGS)[0] is not Outcome.UNKNOWN
    one_run = replace(small, unexplained=Unexplained(1.0, 3.0, 130.0, "b", "b", "run-4"))
    assert decide(one_run, SETTINGS)[0] is Outcome.UNKNOWN


def test_a_cause_that_is_not_in_the_library_is_placed_where_good_runs_hardly_differ() -> None:
    runs = bank(OTHER, {"driver_gain": SHOWN["driver_gain"]})
    good = bank(OTHER, seed=40)[:3]
    verdict = ask(runs, without("driver_gain"), good=good).verdict
    assert verdict.outcome is Outcome.UNKNOWN, verdict.text
    assert verdict.sub_model == "power"
    assert "times what known-good runs differ" in verdict.text
