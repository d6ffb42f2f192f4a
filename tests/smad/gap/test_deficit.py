"""What runs score worse than known-good runs, and the output that good runs hardly differ in."""

from __future__ import annotations

from dataclasses import replace

import pytest
from smad.gap import Settings
from smad.gap.compare.verdict import StandsOut, decide
from smad.gap.fit.deficit import Usual, clearest
from smad.gap.records import Outcome

from tests.smad.gap.cases import OTHER, SHOWN, ask, bank, without
from tests.smad.gap.test_decisions import evidenced, worth

SETTINGS = Settings()


def test_the_output_that_stands_out_does_so_whichever_model_is_asked() -> None:
    usual = Usual({"a": -20.0, "b": -20.0}, {"a": 2.0, "b": 4.0})
    tied, free = {"a": 30.0, "b": 30.0}, {"a": 4.0, "b": 24.0}
    assert clearest(usual, [tied]) == ("a", 15.0)
    assert clearest(usual, [tied, free]) == ("b", 6.0)


@pytest.mark.parametrize("gap", [0.5, 3.0])
@pytest.mark.parametrize(("spreads", "unknown"), [(30.0, True), (3.0, False)])
def test_without_a_cause_it_is_unknown_where_one_output_differs_as_good_ones_never_do(
    gap: float, spreads: float, unknown: bool
) -> None:
    seen = replace(evidenced(worth(gap, 0.0)), stands_out=StandsOut("a", "a", spreads))
    outcome, p = decide(seen, SETTINGS)
    assert (outcome is Outcome.UNKNOWN) == unknown
    assert p > 0.3


def test_a_cause_that_is_not_in_the_library_is_placed_where_good_runs_hardly_differ() -> None:
    runs = bank(OTHER, {"driver_gain": SHOWN["driver_gain"]})
    good = bank(OTHER, seed=40)[:3]
    verdict = ask(runs, without("driver_gain"), good=good).verdict
    assert verdict.outcome is Outcome.UNKNOWN, verdict.text
    assert verdict.sub_model == "power"
    assert "times what known-good runs differ" in verdict.text
