"""Runs of different states in one folder: named, left out, and never one confident answer."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from smad.gap.records import Diagnosis, Outcome
from smad.gap.report import Asked, summary_lines

from smad.cli.gap_runs import remaining
from tests.smad.gap.cases import OTHER, SHOWN, ask, bank, without
from tests.smad.gap.contradicting import apart, counted, mixed
from tests.smad.gap.coverage import PLANTS, covered


@pytest.mark.parametrize("effect", ["sensor_lag", "backlash", "dial_delay", "sticky_fan"])
def test_a_run_without_the_effect_of_three_others_is_named(effect: str) -> None:
    found = ask(mixed(effect, 3))
    assert found.verdict.outcome is Outcome.CONTRADICTING
    assert found.verdict.effects == []
    assert apart(found) == {"sines 4"}


@pytest.mark.parametrize("effect", ["sensor_lag", "backlash"])
def test_a_run_with_an_effect_that_three_others_lack_is_named(effect: str) -> None:
    found = ask(mixed(effect, 1))
    assert found.verdict.outcome is Outcome.CONTRADICTING
    assert apart(found) == {"random 1"}


def test_two_runs_of_each_state_give_no_answer_of_all_four() -> None:
    found = ask(mixed("sensor_lag", 2))
    assert found.verdict.outcome is Outcome.CONTRADICTING


def test_a_pair_of_runs_of_different_states_says_that_neither_agrees_with_the_other() -> None:
    runs = mixed("sensor_lag", 1)[:2]
    found = ask(runs)
    assert found.verdict.outcome is Outcome.CONTRADICTING
    assert apart(found) == {r.name for r in runs}
    assert "contradict each other" in found.verdict.plain


@pytest.mark.parametrize("effect", ["", "sensor_lag", "coupling", "driver_gain"])
def test_runs_of_one_state_do_not_contradict_each_other(effect: str) -> None:
    found = ask(bank(OTHER, {effect: SHOWN[effect]} if effect else {}, seed=20))
    assert found.verdict.outcome is not Outcome.CONTRADICTING
    assert apart(found) == set()


@pytest.mark.parametrize("effect", ["sensor_lag", "coupling"])
def test_runs_with_one_effect_that_the_library_lacks_do_not_contradict_each_other(
    effect: str,
) -> None:
    found = ask(bank(OTHER, {effect: SHOWN[effect]}, seed=520), without(effect))
    assert found.verdict.outcome is Outcome.UNKNOWN
    assert apart(found) == set()


def test_the_words_give_the_gap_by_run_and_the_command_that_leaves_the_run_out() -> None:
    words = "\n".join(summary_lines(ask(mixed("sensor_lag", 3)), Asked("runs")))
    assert words.startswith("Runs contradict each other")
    assert "smad gap diagnose runs --leave-out 'sines 4'" in words
    assert "Gap by run" in words
    assert "not in the library" not in words


def test_a_record_that_was_written_to_json_keeps_what_each_run_says() -> None:
    found = ask(mixed("sensor_lag", 3))
    assert Diagnosis.from_json(found.to_json()).agreement == found.agreement


def test_a_run_is_left_out_by_the_name_of_its_file_and_an_unknown_name_is_refused() -> None:
    runs, held = (Path("r/a.mcap"), Path("r/b.mcap")), (Path("later/c.mcap"),)
    assert remaining((runs, held), ["a"]) == [(Path("r/b.mcap"),), held]
    assert remaining((runs, held), ["c.mcap"]) == [runs, ()]
    with pytest.raises(click.BadParameter, match="'d' is none of the runs given"):
        remaining((runs, held), ["d"])


def test_the_command_counts_every_kind_of_four_runs() -> None:
    found = counted(["sensor_lag"], 0)
    assert found["one state, nothing"] == {"asked": 1, "said": 0, "named": 0}
    assert found["3 of 4 with an effect"] == {"asked": 1, "said": 1, "named": 1}
    assert len(found) == 5


def test_the_coverage_command_counts_an_interval_for_each_repetition() -> None:
    held, asked = covered(PLANTS["heater"], "sensor_lag", 1)
    assert asked == {"tau_s": 1}
    assert held["tau_s"] in (0, 1)


def test_the_coverage_command_records_the_spring_pair_with_the_effect_alone() -> None:
    benches = PLANTS["pair"]
    one, other = (benches.runs("rtd_lag", repetition)[0] for repetition in (0, 1))
    assert one.digest != other.digest
    assert benches.shown["rtd_lag"]["tau_s"] == 0.6
