"""*Changed* on the tiny plant: what is new since good runs, whatever their inputs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from smad.diagnosis import Verdict
from smad.diagnosis.report.words import lines
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CAUSES, CHANGED, MEASURED, PAIRED, PARAMETERS, QUIET
from tests.smad.diagnosis.cases import GAIN, OTHER, ask, bank
from tests.smad.diagnosis.heater_plant import recorded


def good(effects: dict[str, dict[str, float]] | None = None) -> list[GapRun]:
    return bank(OTHER, effects, seed=40)


@pytest.fixture(scope="module")
def new_gain() -> Verdict:
    return ask(bank(OTHER, GAIN), good=good())


def test_what_has_come_since_the_good_runs_is_named_with_its_value(new_gain: Verdict) -> None:
    assert (new_gain.question, new_gain.outcome) == (CHANGED, CAUSES)
    (cause,) = new_gain.causes
    assert cause.name == "driver_gain"
    assert cause.names["driver_gain"] > 0.99
    assert cause.values[0].value == pytest.approx(0.05, abs=0.001)
    assert new_gain.whole is not None
    assert new_gain.whole.final < 1.0


def test_a_bench_as_it_was_has_nothing_new_whatever_its_inputs() -> None:
    found = ask(bank(OTHER)[:2], good=good())
    assert (found.outcome, found.causes) == (QUIET, [])


def test_a_parameter_that_good_runs_say_nothing_of_may_have_any_likely_value() -> None:
    # The fan has blown as now all along; the good runs do not use it, and nothing else is off.
    fan = {"fan_gain": 1.65}
    silent = [
        recorded(family, seed, fan, duration_s=50.0, day=day)
        for family, seed, day in (("still", 1, 1), ("one side", 2, 2))
    ]
    now = [recorded("random", seed, fan, duration_s=50.0, day=5) for seed in (11, 12)]
    found = ask(now, good=silent)
    assert (found.outcome, found.causes) == (QUIET, [])


def test_what_the_good_runs_show_too_is_not_new() -> None:
    found = ask(bank(OTHER, GAIN)[:2], good=good(GAIN))
    assert (found.outcome, found.causes) == (QUIET, [])


def test_what_is_new_is_found_beside_what_was_there() -> None:
    late = {**GAIN, "dial_delay": {"delay_s": 0.5}}
    found = ask(bank(OTHER, late)[:2], good=good(GAIN))
    assert [c.name for c in found.causes] == ["dial_delay"]
    assert found.causes[0].values[0].value == pytest.approx(0.5, abs=0.03)


def test_other_values_of_the_parameters_are_asked_first() -> None:
    found = ask(bank({**OTHER, "ha_W_K": 0.66})[:2], good=good())
    assert (found.outcome, found.causes) == (PARAMETERS, [])
    after = {q.name: q.after for q in found.parameters}
    assert after["ha_W_K"] == pytest.approx(0.66, abs=0.01)


def test_the_order_of_the_runs_does_not_matter(new_gain: Verdict) -> None:
    found = ask(bank(OTHER, GAIN)[::-1], good=good()[::-1])
    assert found.causes == new_gain.causes
    assert found.budget == new_gain.budget


def test_a_channel_that_only_one_group_has_is_switched_off_in_all() -> None:
    lacking = [
        replace(r, outputs={k: v for k, v in r.outputs.items() if k != "rod_um"}) for r in good()
    ]
    found = ask(bank(OTHER, GAIN), good=lacking)
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert "rod_um" not in {s.signal for s in found.budget}
    assert any(f.kind == "channel not shared" for f in found.findings)


def test_a_single_known_good_run_is_said_to_be_too_few() -> None:
    found = ask(bank(OTHER, GAIN)[:2], good=good()[:1])
    (text,) = (f.text for f in found.findings if f.kind == "few runs")
    assert "a single known-good run" in text


def test_an_effect_is_named_where_parameters_have_moved_far_as_well() -> None:
    found = ask(bank({**OTHER, "ha_W_K": 0.66}, GAIN)[:2], good=good())
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert found.causes[0].values[0].value == pytest.approx(0.05, abs=0.005)


WAX = {"melt": {"J_K": 30.0}}
"""What the library lacks, on the good bench as now: half of a plate's capacity."""
WEAK = {"sensor_lag": {"tau_s": 0.2}}


@pytest.fixture(scope="module")
def waxen() -> list[GapRun]:
    return bank(OTHER, WAX, day=1)


def test_what_the_model_gets_wrong_hides_nothing_in_runs_that_repeat_good_ones(
    waxen: list[GapRun],
) -> None:
    now = bank(OTHER, WAX | WEAK)
    found = ask(now, good=waxen)
    (cause,) = found.causes
    assert cause.name == "sensor_lag"
    assert cause.values[0].value == pytest.approx(0.2, abs=0.03)
    other_inputs = ask(bank(OTHER, WAX | WEAK, seed=40), good=waxen)
    assert found.whole is not None
    assert other_inputs.whole is not None
    assert found.whole.causes[0] < 1.0
    assert other_inputs.whole.causes[0] > 1.2
    # Only there gaps are of differences, and table and figure say so.
    assert (found.gaps_of, other_inputs.gaps_of) == (PAIRED, MEASURED)
    assert any("RMS of whitened now − then" in line for line in lines(found))


def test_runs_that_repeat_good_ones_without_a_change_have_nothing_new(waxen: list[GapRun]) -> None:
    found = ask(bank(OTHER, WAX), good=waxen)
    assert (found.outcome, found.causes) == (QUIET, [])


def test_beside_runs_that_repeat_good_ones_and_show_it_others_are_not_judged(
    waxen: list[GapRun],
) -> None:
    repeated, *_ = bank(OTHER, WAX | WEAK)
    (other, *_) = bank(OTHER, WAX | WEAK, seed=40)
    found = ask([repeated], good=waxen, hold_out=[other])
    assert [r.run for r in found.by_run] == [repeated.name]
    compared, *_, alone = found.notes
    assert compared == f"runs of the same inputs were compared: {repeated.name} with random 1 (2)"
    assert f"no good run has their inputs: {other.name}; diagnose them separately" in alone


def test_an_effect_that_shows_in_runs_alone_that_repeat_no_good_one_is_found() -> None:
    repeated, *_ = bank(OTHER, day=3)
    others = bank(OTHER, GAIN, seed=40)
    found = ask([repeated], good=bank(OTHER, day=1), hold_out=others)
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert {r.run for r in found.by_run} == {r.name for r in others}
    assert found.notes[0].startswith(
        "runs that repeat good ones show nothing new; runs with new inputs do: "
    )


def test_where_runs_that_repeat_good_ones_show_other_parameters_the_others_are_judged() -> None:
    moved = {**OTHER, "ha_W_K": 0.66}
    repeated, *_ = bank(moved, day=3)
    others = bank(moved, GAIN, seed=40)
    found = ask([repeated], good=bank(OTHER, day=1), hold_out=others)
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert found.notes[0].startswith(
        "runs that repeat good ones show no cause; runs with new inputs do: "
    )


def test_an_answer_that_nothing_is_new_is_of_all_runs() -> None:
    repeated, *_ = bank(OTHER, day=3)
    (other, *_) = bank(OTHER, seed=40)
    found = ask([repeated], good=bank(OTHER, day=1), hold_out=[other])
    assert found.outcome == QUIET
    assert found.notes[-1] == f"runs with new inputs show nothing new either: {other.name}"


def test_good_runs_of_the_same_inputs_count_as_repeats(waxen: list[GapRun]) -> None:
    once, twice = (
        ask(bank(OTHER, WAX), good=g) for g in (waxen, [*waxen, *bank(OTHER, WAX, day=2)])
    )
    assert any("was recorded good only once" in note for note in once.notes)
    assert not any("was recorded good only once" in note for note in twice.notes)
